"""Samples of outputs that stand for no value, such as -999 or 65535, are left out, as missing ones are.

So are single ones that jump off, and are back at the next sample.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from reconcile import words
from reconcile.recordings import ends
from records.measurement import Channel

JUMP = 0.5  # of its range: an input that changes by so much may be why an output does
SELDOM = 0.95  # of the times, at which it changes by less than there
NEAR = 3  # sample periods before a sample, and one after it
NAMED = 3  # values that are said one by one
BEYOND = "far beyond all others"


def left_out(channels: dict[str, Channel], inputs: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Leave out such samples of outputs, in place; what to say of them, and of inputs, which stay."""
    said = _without(channels, inputs, outputs, ends.far_off, BEYOND)
    for n in inputs:
        if (off := ends.far_off(channels[n].values.astype(float))).any():
            stays = "kept, since an input may be a pulse; leave its cells empty where it is none"
            said.append(f"{_samples(channels[n], off)}, {BEYOND}: {stays}")
    return said


def single(channels: dict[str, Channel], inputs: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Leave out single samples of outputs that jump off, in place; what to say of them."""
    return _without(channels, inputs, outputs, ends.single, "far from those before and after")


def _without(
    channels: dict[str, Channel], inputs: Sequence[str], outputs: Sequence[str],
    which: Callable[[np.ndarray], np.ndarray], why: str,
) -> list[str]:  # fmt: skip
    """Leave out samples of outputs, in place, but where an input jumps; what to say of them."""
    said = []
    for n in outputs:
        channel = channels[n]
        off = which(channel.values.astype(float))
        off &= ~np.any([_jumps(channels[i], channel, off) for i in inputs] or [~off], axis=0)
        if off.any():
            said.append(f"{_samples(channel, off)}, {why}: left out")
            channels[n] = replace(channel, time=channel.time[~off], values=channel.values[~off])
    return said


def _samples(channel: Channel, off: np.ndarray) -> str:
    values = [f"{v:.6g}" for v in np.unique(channel.values[off].astype(float))]
    at = words.listed(values) if len(values) <= NAMED else f"{values[0]} to {values[-1]}"
    count = f"{off.sum()} sample{'s' if off.sum() > 1 else ''}"
    return words.with_unit(f"{count} of {channel.name} at {at}", channel.unit)


def _jumps(channel: Channel, output: Channel, off: np.ndarray) -> np.ndarray:
    """Those of the samples `off` of an output whose row has one at which an input jumps as it seldom does."""
    values = channel.values.astype(float)
    before = np.searchsorted(
        channel.time, output.time[:, None] - output.period_s * np.arange(-1, NEAR + 1), "right"
    )
    near = values[np.clip(before - 1, 0, None)]
    change = np.ptp(near, axis=1)
    jumps = (change > 0.0) & (change >= max(JUMP * float(np.ptp(values)), float(np.quantile(change, SELDOM))))
    row = np.cumsum(np.diff(off, prepend=False))
    return off & np.isin(row, row[off & jumps])
