"""A first model and map from a recording, and whether its units and signs fit."""
