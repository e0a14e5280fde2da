"""Throws on the simulated reference machine: where the load lands, and how long it takes."""
