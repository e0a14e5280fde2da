"""Tests of reconcile: a rig of two states, effects put into it by an integrator of its own."""
