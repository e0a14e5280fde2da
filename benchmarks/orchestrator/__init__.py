"""Measures the orchestrator against a hand-written loop and other masters, each in its own process."""
