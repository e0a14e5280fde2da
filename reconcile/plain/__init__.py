"""Plain ways to say what a model lacks, to compare reconcile with: they take the best fit and never abstain.

sindy       sparse regression of numerically differentiated measurements (pysindy), terms read as effects
greedy_bic  reconcile's own candidates and fits, one effect at a time while BIC falls

`python -m reconcile.plain METHOD MODEL OUT RUN...` writes OUT/report.json with verdict and effects.
"""
