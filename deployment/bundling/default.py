"""The bundle that commands take when none is given."""

from pathlib import Path

from deployment.bundling.build import bundle, identity_of
from fmus.paths import BUILD
from runtime.bundle import OUTSIDE, load
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


def drives_itself(given: Path | None, report: Report) -> Path:
    """The same; raises InputError for one whose controller is a policy outside, for which there is none."""
    folder = ready(given, report)
    if load(folder).engine == OUTSIDE:
        raise InputError(
            f"bundle {folder}: its controller is a policy outside, and here is none; "
            "valid: a bundle with a controller of its own"
        )
    return folder
