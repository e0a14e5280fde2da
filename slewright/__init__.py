"""The `slewright` command, and what joins rooms that may not know each other."""
