"""Tests of the hidden-effect generator: its integrator, effects, cases and scoring."""
