"""Options that say how recordings are read: one group, which every command that reads foreign ones takes."""

import functools
import inspect
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from slewright.channel_names import channel_names
from specs.errors import InputError

MapOption = Annotated[
    Path | None,
    typer.Option("--map", metavar="FILE.toml", help=r"Names: a table \[names] with theirs = 'ours \[unit]'."),
]
TEXT: dict[str, Any] = {  # of a file in text: what is decided from the whole file where nothing is stated
    "decimal": Annotated[
        str | None,
        typer.Option("--decimal", metavar="MARK", help="Text: what stands before the decimals, . or ,"),
    ],
    "thousands": Annotated[
        str | None,
        typer.Option("--thousands", metavar="MARK", help="Text: what groups digits, such as . or , or none."),
    ],
    "encoding": Annotated[
        str | None, typer.Option("--encoding", metavar="NAME", help="Text: utf-8, cp1252, utf-16 …")
    ],
    "skip": Annotated[
        int | None,
        typer.Option("--skip", metavar="N", help="Text: lines before the header that are not read."),
    ],
    "clock": Annotated[
        str | None,
        typer.Option(
            "--clock",
            metavar="'NAME [unit]'",
            help=r"Text and Parquet: the column that is the time, in \[s], \[ms] …, \[excel], \[dd/mm/yyyy].",
        ),
    ],
    "missing": Annotated[
        list[str] | None,
        typer.Option(
            "--missing", metavar="WORD", help="Text: a word for a missing value; several times for several."
        ),
    ],
}


@dataclass(frozen=True)
class Reading:
    """What was stated; `given` as it came from the command line, None where nothing was."""

    given: dict[str, Any] = field(default_factory=dict)

    @property
    def shown(self) -> str:
        """What was stated, as it is written behind a command; "" where nothing was."""
        lists = {name: x if isinstance(x, list) else [x] for name, x in self.given.items() if x is not None}
        words = [f"--{name} {shlex.quote(str(one))}" for name, some in lists.items() for one in some]
        return "".join(f" {word}" for word in words)

    @contextmanager
    def of(self, paths: Sequence[Path], names: Path | None = None) -> Iterator[None]:
        """Within it, what was stated holds for the recordings at `paths`, and the names of the file `names`.

        InputError where it can hold for none of them.
        """
        from records.formats import check_text
        from records.formats.stated import Statement, stated
        from records.formats.text.options import TextOptions

        text = TextOptions(**{k: v for k, v in self.given.items() if v is not None})
        if text.stated and not paths:
            raise InputError(f"{', '.join(text.stated)}: there is no recording that it is for")
        check_text(paths, text)
        with stated(paths, Statement(channel_names(names), text)):
            yield


NOTHING = Reading()


def reads_recordings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the group of options in the place of its parameter `reading`, which gets a `Reading`."""

    @functools.wraps(command)
    def run(**given: Any) -> None:
        reading = Reading({name: given.pop(name) for name in TEXT})
        return command(**given, reading=reading)

    group = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
        for name, kind in TEXT.items()
    ]
    signature = inspect.signature(command)
    before = [p.replace(kind=p.KEYWORD_ONLY) for p in signature.parameters.values()]
    at = next(i for i, p in enumerate(before) if p.name == "reading")
    found = [*before[:at], *group, *before[at + 1 :]]
    run.__signature__ = signature.replace(parameters=found)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in found} | {"return": None}
    return run
