"""Best found optima: what perfect knowledge of a machine reaches, by optimal control.

docs/explanation/optima.md has them.
"""
