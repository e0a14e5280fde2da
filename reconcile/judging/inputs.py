"""Inputs that act in another way than they are recorded: with noise, between their samples, earlier."""

from collections.abc import Mapping, Sequence

from reconcile.equations.model import Folder
from reconcile.recordings import leading, noisy_inputs
from reconcile.recordings.data import Run, split
from reconcile.search.core import Core
from reconcile.tolerances import INPUT_GAIN, LEAST_FLOOR

NEAR = 0.2  # of half a sample: a lead that is so near to a multiple of it is that
LINEAR, CUBIC = 1, 3


def without_noise(folder: Folder, given: Sequence[Sequence[Run]]) -> Sequence[Sequence[Run]]:
    """Runs of each purpose without the noise of inputs, where the model without effects is likelier then.

    Noise that reaches the machine, such as a command's own, makes the outputs likelier with it.
    """
    candidates = noisy_inputs.noisy([r for runs in given for r in runs])
    if not candidates:
        return given
    units = {v.name: v.unit for v in folder.model.inputs}
    least = Core(folder, split(*given)).base.total
    for name in candidates:
        tried = [noisy_inputs.smoothed(runs, name, units[name]) for runs in given]
        total = Core(folder, split(*tried)).base.total
        if total < least - INPUT_GAIN:
            given, least = tried, total
    return given


def set_right(
    folder: Folder, given: Sequence[Sequence[Run]], leads: Mapping[str, float]
) -> Sequence[Sequence[Run]]:
    """Runs of each purpose without the leads (s) of their outputs.

    Where all outputs lead, inputs act earlier.  Half a sample earlier acts what varies between its samples: on
    straight lines or curves, whichever the model without effects finds likelier.
    """
    runs = [r for own in given for r in own]
    shown = {n for r in runs for n in r.outputs}
    alone = {port: m for port in leads if not shown <= {*(m := folder.ports.members(port))}}
    apart = {n: leads[port] for port, m in alone.items() for n in m}
    given = [leading.later(own, {n: _rounded(s, runs) for n, s in apart.items()}) for own in given]
    by_s = _rounded(sum(s for port, s in leads.items() if port not in alone), runs)
    if by_s == 0.5 * leading.input_period(runs):
        ways = [[leading.between(own, degree) for own in given] for degree in (LINEAR, CUBIC)]
        return min(ways, key=lambda sets: Core(folder, split(*sets), (), LEAST_FLOOR).base.total)
    return [leading.earlier(own, by_s) for own in given] if by_s else given


def _rounded(lead_s: float, runs: Sequence[Run]) -> float:
    """A lead (s), or the multiple of half a sample to which it is near."""
    half = 0.5 * leading.input_period(runs)
    nearest = half * round(lead_s / half)
    return nearest if abs(lead_s - nearest) < NEAR * half else lead_s
