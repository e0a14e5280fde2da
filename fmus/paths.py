"""Where things lie; apart from the builder, so that running FMUs needs nothing that generates them."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHIM = ROOT / "fmus" / "shim"
BUILD = ROOT / "build"
BUILT_HERE = BUILD / "built-here"  # an empty file for every FMU, named by its SHA-256


def built_here(sha256: str) -> bool:
    """Whether `build_fmu` made the FMU of this content, so that its machine code is no stranger's."""
    return (BUILT_HERE / sha256).is_file()
