"""Hidden-effect test data: machines with effects nobody tells about, and how an answer about them is scored.

The package has its own equations and its own event-locating integrator and shares no code with the models
and the workflow that it tests; an import-linter contract keeps it so.  README.md says what a case is.
"""
