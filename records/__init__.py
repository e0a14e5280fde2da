"""Run records: what a run wrote down, the four metrics computed from it, and the report that shows it."""
