"""Campaigns: thousands of runs from one plan, on the local cores or a Dask cluster.

plan       the plan file and the runs that it stands for, each with a stable key
worker     one run, in whatever process it is given to; loaded systems are kept
pool       local worker processes that may die; cluster: the same over Dask
journal    results as they come, so that nothing is lost and a campaign goes on where it stopped
run        `run_campaign`: all of it
summary    the page: distributions, worst cases, how to repeat them
"""
