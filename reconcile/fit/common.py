"""What all windows have in common at a point, and what they are differentiated by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from reconcile.fit.late import Late
from reconcile.fit.library import Columns
from reconcile.fit.reading import Delay
from reconcile.model import Attached


@dataclass(frozen=True)
class Common:
    """Of a point's parameters `p` [NP] and `present` effects: what every window needs of them.

    `active`: states that are; `loose`: one over the freedom of the initial value of each; `inputs` and
    `outputs`: their delays.
    """

    p: np.ndarray
    present: tuple[Attached, ...]
    active: np.ndarray
    loose: np.ndarray
    inputs: Mapping[int, float]
    outputs: Mapping[str, Delay]


@dataclass(frozen=True)
class Wanted:
    """Parameters to differentiate by, each a column.

    `shifted`: (column, input that its delay shifts, -1: none), each column once, then further inputs of it.
    `late`: by output the columns that delay it, and whether as a drift of its clock.
    """

    parameters: Sequence[int]
    shifted: Sequence[tuple[int, int]]
    late: Mapping[str, Sequence[tuple[int, bool]]]
    by_steps: dict[int, Columns] = field(default_factory=dict)

    @classmethod
    def of(cls, parameters: Sequence[int], late: Late) -> "Wanted":
        """What is wanted of a model with these delays."""
        shifts = {c: [i for i, qs in late.inputs.items() if q in qs] for c, q in enumerate(parameters)}
        further = [(c, i) for c, inputs in shifts.items() for i in inputs[1:]]
        shifted = [(c, inputs[0] if inputs else -1) for c, inputs in shifts.items()] + further
        place = {q: c for c, q in enumerate(parameters)}
        outputs = {
            n: [
                (place[q], drifts)
                for drifts, qs in ((False, late.outputs[n]), (True, late.clocks[n]))
                for q in qs
                if q in place
            ]
            for n in late.outputs
        }
        return cls(parameters, shifted, {n: found for n, found in outputs.items() if found})

    def columns(self, steps: int) -> Columns:
        """Over a window of so many steps; a delay of several inputs has more columns, which come last."""
        if steps not in self.by_steps:
            n, more = len(self.shifted), len(self.shifted) - len(self.parameters)
            inputs = [i for _, i in self.shifted]
            self.by_steps[steps] = Columns.of([*self.parameters, *[-1] * more], inputs, [0] * n, [steps] * n)
        return self.by_steps[steps]
