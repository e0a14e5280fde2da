"""The inputs of this folder: how each is read, and what came of it in one line a channel."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from records.formats import read_measurement
from records.formats.text import TextOptions
from records.measurement import Channel, Measurement

DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Case:
    """An input, options for it, and what is expected: channels, start and words, or the words of
    a refusal.
    """

    file: str
    options: dict[str, Any] = field(default_factory=dict)
    read: tuple[str, ...] = ()
    start: str = ""
    says: tuple[str, ...] = ()
    refused: str = ""

    def measured(self) -> Measurement:
        """The input as it is read."""
        options = dict(self.options)
        names, dbc, protocol = (
            options.pop("map", None),
            options.pop("dbc", None),
            options.pop("protocol", None),
        )
        text = TextOptions(**options) if options else None
        path = DATA / dbc if dbc else None
        return read_measurement(DATA / self.file, dbc=path, names=names, text=text, protocol=protocol)


def line(channel: Channel) -> str:
    """A channel in one line: name, unit, samples, seconds between them, the first values and the last one."""
    shown = " ".join(f"{float(v):.8g}" for v in channel.values[:3])
    unit = f" [{channel.unit}]" if channel.unit else ""
    first = f" from {channel.time[0]:.6g} s" if channel.time[0] else ""
    step, last = f"{channel.period_s:.6g}", f"{float(channel.values[-1]):.8g}"
    return f"{channel.name}{unit} {len(channel.values)} x {step} s{first}: {shown} .. {last}"
