"""Controllers held against one another and against the paper's: `slewright compare`."""
