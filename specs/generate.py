"""`slewright generate`: writes `specs/generated` from the specs, or tells which files are out of date."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from specs import canopen_eds, dbc, foxglove, places, ros2, tables, urdf
from specs.schema import ROOT

FOLDER = ROOT / "generated"

# Path below specs/generated -> function that renders the file; deterministic to the byte.
GENERATORS: dict[str, Callable[[], str | bytes]] = {
    "slewright.dbc": dbc.render,
    "modbus_map.csv": tables.modbus_csv,
    "fmi_variables.toml": tables.fmi_variables,
    "foxglove_layout.json": foxglove.layout,
    "places.csv": places.table,
    "machine.urdf": urdf.render,
    **{name: partial(lambda of: ros2.files()[of], name) for name in ros2.files()},
    **{name: partial(lambda of: canopen_eds.files()[of], name) for name in canopen_eds.files()},
}


def generators() -> dict[str, Callable[[], str | bytes]]:
    """All generators, those of the system descriptions included (they need lxml)."""
    from specs import ssd  # needs lxml, which the base install lacks

    return {**GENERATORS, **ssd.generators()}


def main(check: bool = False, folder: Path = FOLDER) -> list[Path]:
    """Write every generated file that differs, and remove what nothing generates any more.

    Returns the paths that were out of date; with `check` nothing is written.
    """
    wanted = {folder / name: _bytes(render()) for name, render in generators().items()}
    present = {path for path in folder.rglob("*") if path.is_file()}
    stale = [path for path, content in wanted.items() if path not in present or path.read_bytes() != content]
    orphans = sorted(present - set(wanted))
    if not check:
        for path in stale:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(wanted[path])
        for path in orphans:
            path.unlink()
    return stale + orphans


def _bytes(content: str | bytes) -> bytes:
    return content if isinstance(content, bytes) else content.encode("utf-8")
