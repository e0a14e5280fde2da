"""Whether a bundle's controller may drive the machine that was measured: its margins there, and its plants.

Two questions.  Does its slew loop, on the motion that this machine showed, keep margins of gain and delay?
And is the machine's drive within those of the plants that the bundle was admitted on (`slewright bundle
--plants`)?  A bundle without such a table answers the first only.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence

from baselines.margins import coverage
from baselines.margins.coverage import TABLE, Range
from baselines.margins.drive import Drive
from baselines.margins.loop import Loop
from runtime.bundle import Bundle
from specs import parameters
from specs.errors import InputError


def limits(bundle: Bundle, loops: Sequence[Loop], measured: Drive) -> Iterator[Range]:
    """What is to be kept: margins of all loops, then the drive's figures where there is a table of plants."""
    name = bundle.controller
    for what, margin in margins(loops).items():
        least = parameters.parameter(f"commissioning_{what.replace(' ', '_')}").value
        unit = "s" if what == "delay margin" else ""
        yield Range(f"{what} of controller {name} on this machine", margin, least, math.inf, unit)
    known = plants(bundle)
    if known is None:
        return
    yield Range(f"plants on which controller {name} passed", float(len(known)), 1.0, math.inf, "")
    if known:
        yield from coverage.ranges(measured, list(known.values()))


def margins(loops: Sequence[Loop]) -> dict[str, float]:
    """The least margins of these loops."""
    return {
        "gain margin": min(loop.gain_margin for loop in loops),
        "delay margin": min(loop.delay_margin_s for loop in loops),
    }


def plants(bundle: Bundle) -> Mapping[str, Drive] | None:
    """plant -> its drive, where the bundle's controller passed; None for a bundle without a table."""
    path = bundle.folder / TABLE
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: no JSON ({error}); build the bundle again") from None
    return coverage.passed(content, str(path))


def look(bundle: Bundle) -> str:
    """What to do about a limit that is not kept."""
    known = plants(bundle)
    tried = "" if known is None else f"it passed on {', '.join(known) or 'no plant'}; "
    return (
        f"controller {bundle.controller}: {tried}take one that was tried on such a drive (slewright bundle … "
        "--plants), or tune it for one (slewright tune … --plant)"
    )
