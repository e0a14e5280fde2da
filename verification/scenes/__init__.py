"""Controllers in scenes: runs on the simulated reference machine, contacts, scores."""
