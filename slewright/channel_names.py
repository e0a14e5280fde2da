"""The file of `--map`: our names for the channels of a recording."""

from pathlib import Path

from specs.errors import InputError


def channel_names(path: Path | None) -> dict[str, str]:
    """Theirs -> ours; InputError for a file that is none."""
    if path is None:
        return {}
    from specs.schema import read_toml

    data = read_toml(path)
    names = data.pop("names", None)
    if data or not isinstance(names, dict) or not all(isinstance(n, str) for n in names.values()):
        wrong = f"unknown key {next(iter(data))}" if data else "no table [names] of texts"
        raise InputError(f"{path}: {wrong}; write it as [names] and lines 'their name' = 'our name [unit]'")
    return names
