"""Inputs that were measured with noise: whether the outputs are likelier without it."""

from collections.abc import Sequence

from reconcile.equations.model import Folder
from reconcile.recordings import noisy_inputs
from reconcile.recordings.data import Run, split
from reconcile.search.core import Core
from reconcile.tolerances import INPUT_GAIN


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
