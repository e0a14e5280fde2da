"""The bundle that commands take when none is given."""

from pathlib import Path

from deployment.bundling.build import bundle, identity_of
from fmus.paths import BUILD
from runtime.bundle import load
from specs.errors import InputError
from specs.progress import Report

CONTROLLER = "pd"  # needs no training, and is what others are compared with
FOLDER = BUILD / "bundles"


def ready(given: Path | None, report: Report) -> Path:
    """`given`, or the bundle of CONTROLLER in the build folder, built anew if it is not of this version."""
    if given is not None:
        return given
    folder = FOLDER / CONTROLLER
    try:
        current = load(folder).identity == identity_of(CONTROLLER)
    except InputError:
        current = False
    if not current:
        report(f"building the bundle of {CONTROLLER}")
        folder.parent.mkdir(parents=True, exist_ok=True)
        bundle(CONTROLLER, folder)
    return folder
