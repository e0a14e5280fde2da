"""Where files are. Running FMUs needs this module, but nothing that generates them."""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHIM = ROOT / "fmus" / "shim"
BUILD = ROOT / "build"
BUILT_HERE = BUILD / "built-here"  # an empty file for every FMU, named by its SHA-256


def built_here(sha256: str) -> bool:
    """Whether `build_fmu` made the FMU of this content: its machine code is our own."""
    return (BUILT_HERE / sha256).is_file()
