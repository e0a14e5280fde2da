"""Run records: what a run wrote down, the four metrics computed from it, and the report pages that show
it."""
