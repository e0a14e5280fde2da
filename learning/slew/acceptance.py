"""Whether a network from elsewhere fits a recording: its statistics, the senses of its channels, its error.

What is plainly wrong is refused with the channel and both ranges; how good the rest is, is left to the reader
of the 10 s open-loop errors, beside those of a speed that stays what it was.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from fmus.models.slew import traces
from fmus.models.slew_nn.network import HISTORY, Mlp, SlewNetwork
from learning.slew.description import CHANNELS, PLACES, SI
from learning.slew.score import HORIZON, STRIDE, Score, predictor, roll_out, score
from learning.slew.trajectory import Trajectory, Windows, of_measurement, of_trace, windows
from records.formats import read_measurement
from specs.errors import InputError
from specs.signals import signal

FAR = 6.0  # deviations from a stated mean: beyond, data and statistics are of different things
MOST_FAR = 0.05  # share of samples beyond: a pressure peak is not a wrong unit
TURNED = 0.5  # with a channel turned, an error this much smaller says that its sense is wrong
STRETCH = (0.7, 1.4)  # of the joystick, in which a better full scale is looked for
OTHER_INERTIA = (0.5, 2.0)  # of the inertia, in which a better number is looked for
SEARCH = {"xatol": 0.002, "maxiter": 20}
SIGNALS = {"u": "u_slew", "p_l": "p_slew_b", "p_r": "p_slew_a", "omega": "qd_slew", "inertia": "inertia"}
SENSES: dict[str, Callable[[Trajectory], Trajectory]] = {
    "channel u turned round": lambda t: replace(t, u=-t.u),
    "channel omega turned round": lambda t: replace(t, omega=-t.omega),
    "channels p_l and p_r exchanged": lambda t: replace(t, p_l=t.p_r, p_r=t.p_l),
}


@dataclass(frozen=True)
class Acceptance:
    """10 s open-loop errors of the network on a recording; `held` those of a speed that does not change."""

    network: Score
    held: Score
    outside: float | None  # share of samples where the network had no training data, if that is known
    inertia: tuple[float, float] | None = None  # factor with which the errors are this share of those as told

    @property
    def worthless(self) -> bool:
        """No better than a speed that does not change."""
        return self.network.velocity_mae >= self.held.velocity_mae


def trajectories(path: Path, inertia: tuple[float, float] | None = None) -> list[Trajectory]:
    """A recording of any known format, or a CSV of the slew traces' form.

    A recording's inertia is the project's, of its poses; a trace states the number that the network was
    trained on, which `inertia` (SlewNetwork.inertia_map) takes to the project's.
    """
    if path.suffix == ".csv" and path.is_file() and _is_trace(path):
        scale, offset = inertia or (1.0, 0.0)
        found = of_trace(traces.read(path))
        return [replace(found, inertia=(found.inertia - offset) / scale)]
    return of_measurement(read_measurement(path), path.stem)


def accept(network: SlewNetwork, recording: Sequence[Trajectory]) -> Acceptance:
    """Check `network` against a recording; raises InputError naming channel and ranges if it does not fit."""
    for name, members in (("pressure", network.pressure), ("velocity", network.velocity)):
        for net in members:
            _check_plausible(name, net)
            _check_data(name, net, recording)
    _check_outputs(network, recording)
    cut = windows(recording, HISTORY, HORIZON, STRIDE)
    found = score(predictor(network), cut)
    if not np.isfinite(found.velocity_mae):
        raise InputError(
            "the network runs away on this recording: its predictions are not finite within 10 s"
        )
    _check_senses(network, recording)
    _check_scale(network, recording)
    inertia = _better(network, recording, "inertia", OTHER_INERTIA)
    return Acceptance(found, score(_held, cut), _outside(network, recording), inertia)


def _check_plausible(name: str, net: Mlp) -> None:
    """Mean within the signal's range, deviation no wider than it."""
    for channel, mean, std in _statistics(net):
        known = signal(SIGNALS[channel])
        low, high = float(known.min or 0.0), float(known.max or 0.0)
        if not low <= mean <= high or std > high - low:
            raise InputError(
                f"channel {channel} of the {name} network: mean {mean:.4g} and deviation {std:.4g} "
                f"{SI[channel]} cannot be of a quantity within {low:g} … {high:g}: wrong unit, scale or sign?"
            )


def _check_data(name: str, net: Mlp, recording: Sequence[Trajectory]) -> None:
    for channel, mean, std in _statistics(net):
        values = np.concatenate([getattr(t, channel) for t in recording])
        far = float(np.mean(np.abs(values - mean) > FAR * std))
        if far > MOST_FAR:
            raise InputError(
                f"channel {channel} of the {name} network: mean {mean:.4g}, deviation {std:.4g} "
                f"{SI[channel]}; the recording has {values.min():.4g} … {values.max():.4g}, {100 * far:.0f} %"
                f" of it beyond {FAR:g} deviations: wrong unit, scale, sign, order or no statistics?"
            )


def _check_outputs(network: SlewNetwork, recording: Sequence[Trajectory]) -> None:
    """One step ahead of what was recorded, no output is further off than its whole range."""
    one = windows(recording, HISTORY, 1, 1)
    for channel, values in zip(("p_l", "p_r", "omega"), roll_out(network, one), strict=True):
        wanted = getattr(one, channel)[:, one.before :]
        if not np.median(np.abs(values - wanted)) <= np.ptp(wanted):
            raise InputError(
                f"output {channel}: predicts {values.min():.4g} … {values.max():.4g} {SI[channel]} where the "
                f"recording has {wanted.min():.4g} … {wanted.max():.4g}: wrong mean_out, std_out or residual?"
            )


def _check_senses(network: SlewNetwork, recording: Sequence[Trajectory]) -> None:
    """A network that does far better with a channel turned was described the wrong way round."""
    described = _mismatch(network, recording)
    turned = {what: _mismatch(network, list(map(turn, recording))) for what, turn in SENSES.items()}
    best = min(turned, key=lambda what: turned[what].sum())
    ratios = turned[best] / described
    if ratios.min() < TURNED and ratios.max() <= 1.0:
        raise InputError(
            f"10 s errors of pressures and speed are {_deviations(described)} as described and "
            f"{_deviations(turned[best])} with {best}: mend the description"
        )


def _check_scale(network: SlewNetwork, recording: Sequence[Trajectory]) -> None:
    """A network that does far better with the joystick stretched was given another full scale."""
    if found := _better(network, recording, "u", STRETCH):
        factor, share = found
        raise InputError(
            f"10 s errors of pressures and speed are {share:.0%} of those as described with "
            f"channel u times {factor:.3g}: wrong full scale of the joystick, or another machine's recording?"
        )


def _better(
    network: SlewNetwork, recording: Sequence[Trajectory], channel: str, bounds: tuple[float, float]
) -> tuple[float, float] | None:
    """(factor of a channel, share of the errors that are left with it), where that is far less than all."""

    def error(factor: float) -> float:
        stretched = [replace(t, **{channel: factor * getattr(t, channel)}) for t in recording]
        return float(_mismatch(network, stretched).sum())

    found, told = minimize_scalar(error, bounds=bounds, method="bounded", options=SEARCH), error(1.0)
    return (float(found.x), found.fun / told) if found.fun < TURNED * told else None


def _mismatch(network: SlewNetwork, recording: Sequence[Trajectory]) -> np.ndarray:
    """Mean 10 s open-loop errors of (pressures, speed), in deviations of the recorded ones."""
    cut = windows(recording, HISTORY, HORIZON, STRIDE)
    errors = []
    for channel, found in zip(("p_l", "p_r", "omega"), roll_out(network, cut), strict=True):
        recorded = getattr(cut, channel)
        errors.append(np.abs(found - recorded[:, cut.before :]).mean() / max(float(recorded.std()), 1e-12))
    return np.array([(errors[0] + errors[1]) / 2, errors[2]])


def _deviations(errors: np.ndarray) -> str:
    return f"{errors[0]:.2g} and {errors[1]:.2g} deviations"


def _statistics(net: Mlp) -> Iterator[tuple[str, float, float]]:
    """(channel, mean, deviation) in SI, over the channel's history."""
    for channel in CHANNELS:
        at = [i for i, (name, _) in enumerate(PLACES) if name == channel]
        yield channel, float(net.mean_in[at].mean()), float(net.std_in[at].mean())


def _outside(network: SlewNetwork, recording: Sequence[Trajectory]) -> float | None:
    if not network.knows_region:
        return None
    return float(np.mean(np.concatenate([network.outside(t.inertia, t.u, t.omega) for t in recording])))


def _held(of: Windows) -> np.ndarray:
    return np.repeat(of.omega[:, of.before - 1 : of.before], of.u.shape[1] - of.before, axis=1)


def _is_trace(path: Path) -> bool:
    with path.open(encoding="utf-8", errors="replace") as file:
        return {"p_l", "p_r", "omega", "inertia"} <= set(file.readline().strip().split(","))
