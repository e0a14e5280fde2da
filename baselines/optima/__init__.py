"""Best found optima: what perfect knowledge of a machine reaches, by optimal control.

docs/results/optima.md has them.
"""
