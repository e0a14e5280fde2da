"""The hidden-effect suite: cases drawn, answered by the workflow without knowing the truth, scored.

plan        which case is what: system and seed of each, from the suite's seed alone
work        one case, in whatever process it is given to: drawn, answered, scored; files in its folder
answers     what an answer is given, and its score
experiment  an ambiguous case's experiment on its hidden machine, answered again (experiments: published)
child       the process that answers, and what it cost
parameters  the generator's parameters in the names of a report
run         all cases over local processes or Dask; goes on where it stopped
summary     what is published of the cases that are there
"""
