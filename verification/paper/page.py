"""The items as one page: Markdown with pictures beside it, and the same as one HTML file."""

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from learning.policy.session import source_state
from records.figures_file import versions, write_text
from verification.dossier.page import as_html, write
from verification.dossier.section import Section
from verification.paper import curves, trials
from verification.paper.asked import Asked
from verification.paper.items import Item
from verification.paper.made import filled

TITLE = "The paper, line by line"
INTRO = """
Every table and figure of the paper (Spinelli et al., *Reinforcement Learning Control for Autonomous Hydraulic
Material Handling Machines with Underactuated Tools*) in its order, its numbers beside ours. The paper's
were measured on its machine. **All of ours are simulated**, on three plants: the *nominal simulation*
(hydraulic slew drive, arm and tool as in the paper), the same with *the authors' published networks* as
the slew drive, and the *simulated reference machine*. [Plants](plants.md) tells them apart.

`slewright reproduce{words}` makes this page: version {version}, commit {commit}, {date}, seed {seed},
{targets} drawn targets of 45–135° for each cell of Tables IV to VI. {training} What is finished is kept
in `--out`, and an interrupted run goes on. `--json FILE` has every figure.

Fig. 1 (a photograph), Fig. 4 (forces on the tool) and Fig. 5 (ROS 2 nodes) are drawings without results.
"""
TRAINING = {
    "full": "Slew models and policies were trained anew.",
    "tiny": "**Trainings were cut down to seconds: these figures only show that everything runs.**",
    "": "Nothing that is shown was trained: policies are those that ship, slew models those of a stored "
    "training. The data routine alone trains an early slew model, for its closed loop.",
}


def compose(items: Sequence[Item], found: Mapping[str, Mapping[str, Any]]) -> list[Section]:
    """A section for each item, and how policies were trained where there are any."""
    sections = [_section(item, found[item.name]) for item in items]
    return [*sections, curves.section()] if any(item.roles for item in items) else sections


def text(asked: Asked, names: Sequence[str], sections: Sequence[Section]) -> str:
    """The page as Markdown; `names`: the items that were asked for, none for all."""
    words, commit = " ".join(["", *names]) + asked.words, source_state()
    intro = INTRO.strip().format(
        words=words, version=versions()["slewright"], commit=commit, date=date.today(), seed=asked.seed,
        targets=asked.effort.targets, training=TRAINING[asked.effort.training],
    )  # fmt: skip
    parts = [f"# {TITLE}", *map(filled, intro.split("\n\n"))]
    for section in sections:
        parts += [f"## {section.title}", section.text]
    return "\n\n".join(parts) + "\n"


def _section(item: Item, made: Mapping[str, Any]) -> Section:
    shown = [f"![{caption(name)}](PICTURES/{name})" for name in made["pictures"]]
    against = trials.ratios(made) if "rows" in made["paper"] and item.roles else ""
    said = [f"`{made['command']}`", made["text"], "\n".join(shown)]
    said += [filled(f"Reference machine over paper: {against}.")] if against else []
    parts = [*said, filled(f"**Where they differ.** {item.why}")]
    return Section(
        item.name, f"{item.place}: {item.title}", "\n\n".join(filter(None, parts)), made, made["pictures"]
    )


def caption(picture: str) -> str:
    """What a picture's file name says."""
    return picture.removesuffix(".svg").replace("-", " ")


def write_html(path: Path, content: str, sections: Sequence[Section]) -> None:
    """One file with its pictures inside."""
    write_text(path, as_html(content, sections, TITLE))


def write_markdown(path: Path, content: str, sections: Sequence[Section]) -> None:
    """The page, its pictures in a folder of its name beside it."""
    write(path, content, sections)
