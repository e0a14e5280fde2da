"""Chapter: how close the machine is to one that was recorded, as `slewright shadow` found it."""

import json
from pathlib import Path
from typing import Any

from specs.errors import InputError
from verification.dossier.markdown import number, significant, table
from verification.dossier.section import Section

TITLE = "Against a recorded machine"
COLUMNS = ("signal", "unit", "RMSE", "moved by", "FIT %")


def read(path: Path) -> dict[str, Any]:
    """The figures of a report of `slewright shadow`; InputError for a file that is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        signals = content["closeness"]["signals"]
        whole = all({"unit", "rmse", "moved", "fit_percent"} <= s.keys() for s in signals.values())
        if not whole or not {"machine", "load_kg", "pieces", "seconds"} <= content["closeness"].keys():
            raise KeyError("closeness is not whole")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"--recorded {path}: no report.json of slewright shadow ({error})") from None
    return content


def section(content: dict[str, Any]) -> Section:
    """The chapter."""
    found = content["closeness"]
    text = (
        f"The operator's commands of a recording in shadow mode (`{content.get('recording', '')}`, machine: "
        f"{content.get('label') or 'as recorded'}) once more on the reference machine ({found['machine']}, "
        f"{number(found['load_kg'], 0)} kg), open loop: {found['pieces']} pieces, "
        f"{number(found['seconds'], 0)} s, each begun at rest in the recorded pose. "
        "Nothing is fitted to it, and no limit is set.\n\n"
    )
    rows = [
        [name, s["unit"], *(significant(s[k], 3) for k in ("rmse", "moved")), _fit(s["fit_percent"])]
        for name, s in found["signals"].items()
    ]
    shown = table(COLUMNS, rows) if rows else "No piece began at rest and moved: nothing to compare."
    return Section("recorded", TITLE, text + shown, figures=found)


def _fit(value: float | None) -> str:
    return "–" if value is None else number(value, 1)
