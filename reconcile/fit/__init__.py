"""Simulation-error fits over windows with free initial states and exact sensitivities."""
