"""Puts another limit on the joystick's change into a trained policy, which stays as it is otherwise.

    python -m learning.policy.limit POLICY --change C --out FILE

A limit lets less pass of what is fast, where nothing is to be gained by driving, and where another drive than
the one that was trained on may answer too much.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from learning.policy.export import read, write
from records.figures_file import check_target
from specs.errors import InputError
from specs.policy import MOST_CHANGE
from specs.version import VERSION


def limit(policy: Path, change: float, out: Path) -> Path:
    """Write the policy with a limit of `change` a period (0: without one); InputError for another."""
    check_target(out)
    found = read(policy)
    if not 0.0 <= change <= MOST_CHANGE:
        raise InputError(f"change {change:g}; valid: 0 to {MOST_CHANGE:g}")
    note = f"limited to a change of {change:g} a period by learning.policy.limit, version {VERSION}"
    made = {**found.contract.made, "after": note}
    return write(replace(found, contract=replace(found.contract, change=change, made=made)), out)


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, as `slewright` does."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}\n")


def main(words: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = Parser(prog="python -m learning.policy.limit")
    parser.add_argument("policy", type=Path)
    parser.add_argument("--change", type=float, required=True)
    parser.add_argument("--out", type=Path, required=True)
    told = parser.parse_args(words)
    try:
        limit(told.policy, told.change, told.out)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
