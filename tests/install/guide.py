"""The commands of docs/how-to/installation.md: what is on that page is what is executed here."""

import re
from dataclasses import dataclass
from pathlib import Path

from tests.conftest import ROOT

GUIDE = ROOT / "docs" / "how-to" / "installation.md"
PLACES = ("workstation", "controller", "running")  # "" is shown only
BLOCK = re.compile(r"^```sh *([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """One block of commands: where it belongs, whether it needs a network, and its line in the guide."""

    place: str
    online: bool
    text: str
    line: int


def blocks(path: Path = GUIDE) -> list[Block]:
    """All blocks in their order; ValueError for one whose place is none."""
    text = path.read_text()
    found = []
    for match in BLOCK.finditer(text):
        place, _, more = match[1].partition(" ")
        if place not in (*PLACES, "") or more not in ("", "online"):
            raise ValueError(f"{path.name}: a block for '{match[1]}'")
        found.append(Block(place, more == "online", match[2], text.count("\n", 0, match.start()) + 1))
    return found


def of(place: str) -> list[Block]:
    """Those of one place."""
    return [block for block in blocks() if block.place == place]
