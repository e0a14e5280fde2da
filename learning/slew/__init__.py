"""Slew models from recordings: the paper's networks, what they are compared with, and how far each is off."""
