"""What was typed, for pages that say which command made them."""

import shlex
import sys
from itertools import pairwise

ELSEWHERE = ("--json", "--out", "--page", "--jobs")  # options about where results go, or how fast they come


def command() -> str:
    """The command line without where the results go."""
    words = [
        shlex.quote(word)
        for before, word in pairwise(["", *sys.argv[1:]])
        if word not in ELSEWHERE and before not in ELSEWHERE
    ]
    return f"slewright {' '.join(words)}"
