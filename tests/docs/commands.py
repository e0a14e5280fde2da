"""Looks up every command, option, make target and path that the Markdown pages show.

    python -m tests.docs.commands      lists what does not exist; exit code 1 if there is anything

Checked are code blocks of a shell (or without a language) and inline code: `slewright …`, `python -m
benchmarks …` with their options, `make …`, `python -m room.module` and `room/file`.
"""

import re
import shlex
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from slewright.app import COMMANDS, ROOMS, load_command

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (*ROOMS, "benchmarks", "blindtest", "tests", "docs", "requirements", "examples")
SHELLS = ("sh", "bash", "console", "")
BLOCK = re.compile(r"^(```+)[ ]*([\w{}-]*)[^\n]*\n(.*?)^\1[ ]*$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
# A program where a command begins: at the start of a line, after ; & | ( or --, or with its path.
CALL = re.compile(
    r"(?:^\s*(?:\$ )?|[;&|(]\s*|-- |/bin/)(slewright|make|python3? -m [\w.]+)(?=\s|$)"
    r"((?:\s+(?:\"[^\"]*\"|'[^']*'|[^\s;&|#<>()]+))*)"
)
WORD = re.compile(r"[a-z][\w-]*$")
MADE_PATH = re.compile(rf"(?:{'|'.join(FOLDERS)})/[\w./-]*[\w/]$")


def pages() -> list[Path]:
    """The Markdown files of the project that show commands, but the changelog, which has old ones."""
    found = [*ROOT.glob("*.md"), *(p for name in FOLDERS for p in (ROOT / name).rglob("*.md"))]
    return sorted(p for p in found if p.name != "CHANGELOG.md" and "chapters" not in p.parts)


def problems(text: str) -> list[str]:
    """What a page's commands name that does not exist, with the line where it stands."""
    return [f"{line}: {said}" for line, code in _code(text) for said in _check(code)]


def _code(text: str) -> Iterator[tuple[int, str]]:
    """(line number, code) of each line of a shell's block, and of all inline code."""
    prose = text
    for block in BLOCK.finditer(text):
        blank = "\n" * block.group().count("\n")
        prose = prose.replace(block.group(), blank, 1)
        if block.group(2) in SHELLS:
            first = text.count("\n", 0, block.start(3)) + 1
            # A line that goes on after a backslash counts as one, at its beginning.
            code = re.sub(r"\\\n(.*)", r" \1\n", block.group(3))
            yield from enumerate(code.splitlines(), first)
    for inline in INLINE.finditer(prose):
        yield prose.count("\n", 0, inline.start()) + 1, " ".join(inline.group(1).split())


def _check(code: str) -> Iterator[str]:
    if MADE_PATH.fullmatch(code) and not (ROOT / code).exists():
        yield f"there is no {code}"
    for program, rest in CALL.findall(code):
        try:
            words = shlex.split(rest, comments=True)
        except ValueError:
            words = rest.split()
        if program == "slewright":
            yield from _wrong_words("slewright", _slewright(), words)
        elif program == "make":
            yield from (f"make has no target '{w}'" for w in words if WORD.match(w) and w not in _targets())
        elif program.endswith(" benchmarks"):
            yield from _wrong_words("python -m benchmarks", _benchmarks(), words)
        else:
            yield from _wrong_module(program.split()[-1])


def _wrong_words(path: str, commands: dict[str, Any], words: list[str]) -> Iterator[str]:
    """Follow the words down to a command; then every option must be one of its own."""
    options = {"--help", "-h", "--version", "--traceback"}
    for word in words:
        name = word.split("=")[0]
        if word.startswith("-") and not re.match(r"-\d", word):
            if re.match(r"--?[a-z]", word) and name not in options:
                yield f"'{path}' has no option '{name}'"
        elif commands and WORD.match(word):
            if word not in commands:
                yield f"'{path}' has no command '{word}'"
                return
            path, command = f"{path} {word}", commands[word]
            commands = _inner(command)
            options |= {option for p in command.params for option in (*p.opts, *p.secondary_opts)}


def _inner(command: Any) -> dict[str, Any]:
    return dict(command.commands) if isinstance(command, TyperGroup) else {}


@cache
def _slewright() -> dict[str, Any]:
    return {name: load_command(name) for name in COMMANDS}


@cache
def _benchmarks() -> dict[str, Any]:
    from benchmarks.__main__ import app as benchmarks

    group: Any = typer.main.get_command(benchmarks)
    return {name: group.get_command(None, name) for name in group.commands}


@cache
def _targets() -> set[str]:
    return set(re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def _wrong_module(name: str) -> Iterator[str]:
    path = ROOT.joinpath(*name.split("."))
    if name.split(".")[0] in FOLDERS and not (path.with_suffix(".py").is_file() or path.is_dir()):
        yield f"there is no module {name}"


def main() -> int:
    """Print every problem; 1 if there is one."""
    found = [f"{p.relative_to(ROOT)}:{said}" for p in pages() for said in problems(p.read_text("utf-8"))]
    print(*found, f"commands in {len(pages())} pages: {len(found)} do not exist", sep="\n")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
