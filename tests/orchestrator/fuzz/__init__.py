"""Fuzzing of everything that reads files of others: SSD, SSV, SSM, SSB, modelDescription.xml and zip.

`python -m tests.orchestrator.fuzz --minutes 10` mutates the corpus (corpus.json.gz), aware of its structure,
keeps what reaches new edges in orchestrator/*.py, and asks of every input: it is accepted, or refused with
an InputError of at most two lines; within bounded time and memory.  What is accepted is stepped in a core
built with -fsanitize=address,undefined, in a process of its own.  test_corpus.py replays the corpus.
"""
