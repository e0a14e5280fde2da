"""Who stands at the machine: questions of the procedure and where their answers come from.

While an answer is waited for the cycle goes on: `Person` looks at the terminal every tick.  A question that
asks what was seen (`WITNESS`) is never answered by the program: two reversed signs hide each other, and
only somebody who looks at the machine can tell.
"""

import os
import select
import sys
from collections.abc import Generator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import typer

from specs.errors import RunError

Answering = Generator[None, None, str]  # yields once a tick, returns the answer

BEGIN = "begin"  # key of the question before each step


class Kind(Enum):
    """What is asked for."""

    DO = "do"  # something to be done; Enter when it is done
    WITNESS = "witness"  # what was seen: yes or no
    NUMBER = "number"  # something measured at the machine


@dataclass(frozen=True)
class Question:
    """`key` is what the simulated operator knows it by."""

    kind: Kind
    key: str
    text: str
    unit: str = ""


class Operator(Protocol):
    """Answers questions; `name` goes into the records."""

    name: str

    def answer(self, question: Question) -> Answering:
        """The answer: "" for done, "yes" or "no", or a number."""
        ...

    def watching(self) -> None:
        """Motion begins that will be asked about."""
        ...


class Person:
    """Somebody at the terminal.  With `ready`, each step begins without asking."""

    def __init__(self, name: str, ready: bool = False) -> None:
        self.name, self.ready = name, ready
        self._typed = ""

    def watching(self) -> None:
        """Said before each motion."""

    def answer(self, question: Question) -> Answering:
        """See `Operator`; asks again until the answer is one."""
        hint = {Kind.DO: "Enter when done", Kind.WITNESS: "yes or no", Kind.NUMBER: question.unit}[
            question.kind
        ]
        while True:
            typer.echo(f"  > {question.text} [{hint}] ", nl=False)
            if question.key == BEGIN and self.ready:
                typer.echo("")
                return ""
            text = yield from self._line()
            if question.kind is Kind.DO or _valid(question, text):
                return text.lower()
            typer.echo(f"    '{text}' is no answer: {hint}")

    def _line(self) -> Answering:
        """A line from the terminal; RunError when there is none any more.

        Read as bytes: a text stream would keep lines that came together, and nobody would see them waiting.
        """
        place = sys.stdin.fileno()
        while "\n" not in self._typed:
            while not select.select([place], [], [], 0)[0]:
                yield
            data = os.read(place, 4096)
            if not data:
                raise RunError("nobody answers: the terminal is closed")
            self._typed += data.decode(errors="replace")
        line, _, self._typed = self._typed.partition("\n")
        return line.strip()


def _valid(question: Question, text: str) -> bool:
    if question.kind is Kind.WITNESS:
        return text.lower() in ("yes", "no")
    try:
        return abs(float(text)) < 1e6
    except ValueError:
        return False
