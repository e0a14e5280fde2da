"""Collision-free paths for slew, boom and stick, and their timing."""
