"""Samples of outputs that stand for no value, such as -999 or 65535, are left out, as missing ones are."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconcile import words
from reconcile.recordings import ends
from records.measurement import Channel

JUMP = 0.5  # of its range: an input that changes by so much may be why an output does
SELDOM = 0.95  # of the times, at which it changes by less than there
NEAR = 3  # sample periods before a sample, and one after it
NAMED = 3  # values that are said one by one


def left_out(channels: dict[str, Channel], inputs: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Leave out such samples of outputs, in place; what to say of them, and of inputs, which stay."""
    said = []
    for n in outputs:
        channel = channels[n]
        off = ends.far_off(channel.values.astype(float))
        off &= ~np.any([_jumps(channels[i], channel, off) for i in inputs] or [~off], axis=0)
        if off.any():
            said.append(f"{_samples(channel, off)}: left out")
            channels[n] = replace(channel, time=channel.time[~off], values=channel.values[~off])
    for n in inputs:
        if (off := ends.far_off(channels[n].values.astype(float))).any():
            stays = "kept, since an input may be a pulse; leave its cells empty where it is none"
            said.append(f"{_samples(channels[n], off)}: {stays}")
    return said


def _samples(channel: Channel, off: np.ndarray) -> str:
    values = [f"{v:.6g}" for v in np.unique(channel.values[off].astype(float))]
    at = words.listed(values) if len(values) <= NAMED else f"{values[0]} to {values[-1]}"
    count = f"{off.sum()} sample{'s' if off.sum() > 1 else ''}"
    return f"{words.with_unit(f'{count} of {channel.name} at {at}', channel.unit)}, far beyond all others"


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
