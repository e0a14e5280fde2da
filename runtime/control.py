"""The control core of a bundle, loaded: `step` from an input image to an output image.

A core keeps nothing but its state, so a snapshot is a copy of that, and a core that is given the same state
and the same inputs does the same, bit for bit, here or on another platform.
"""

import ctypes
from collections.abc import Mapping, Sequence

import numpy as np

from runtime.bundle import PARAMETERS, Bundle, parameters_of
from runtime.image import INPUT, OUTPUT, Address, token
from specs.errors import InputError

LOAD, NONE = "load_estimate", -1.0  # kg: not known
AXES = ("u_slew", "u_boom", "u_stick")
# Why the gate, or the guard, may change a command, by the bits of slr_explain.
REASONS = ("range", "rate", "speed", "keep_out", "joint_limit", "sensor", "authority", "guard")
FORESEEN = 2 * len(AXES) + 2  # lo and hi of each joint [rad], swing, room [m]


class ControlCore:
    """One running control core; not for several threads at once."""

    def __init__(self, bundle: Bundle) -> None:
        """Load the core of this platform, in its first state; InputError if it is not the bundle's."""
        self.bundle = bundle
        path = bundle.library()
        try:
            library = ctypes.PyDLL(str(path))  # keeps the interpreter's lock: a step is so short
        except OSError as error:
            raise InputError(f"bundle {bundle.folder}: {path.name} cannot be loaded ({error})") from None
        self._check(library)
        self.library = library
        self._step = library.slr_step
        self._step.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p]
        self._step.restype = None
        self._reset = library.slr_reset
        self._reset.argtypes, self._reset.restype = [ctypes.c_void_p], None
        self._restart = library.slr_restart
        self._restart.argtypes = [ctypes.c_void_p, ctypes.c_int32, ctypes.c_int32, ctypes.c_double]
        self._restart.restype = None
        self._explain = library.slr_explain
        self._explain.argtypes, self._explain.restype = [ctypes.c_void_p] * 5, None
        self._foresee = library.slr_foresee
        self._foresee.argtypes, self._foresee.restype = [ctypes.c_void_p] * 4, None
        self._ladder = library.slr_ladder
        self._ladder.argtypes, self._ladder.restype = [ctypes.c_void_p] * 3, None
        self._limit = library.slr_limit
        self._limit.argtypes, self._limit.restype = [ctypes.c_void_p, ctypes.c_void_p], None
        self._state = np.zeros(library.slr_state_size() // 8, np.int64)
        self._outputs = OUTPUT.new()
        self._at = Address(INPUT)
        self._at_state, self._at_outputs = self._state.ctypes.data, self._outputs.ctypes.data
        self.reset()

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        """The output image of tick `tick`; the same array is written again in the next step."""
        self._step(self._at(inputs), self._at_state, tick, self._at_outputs)
        return self._outputs

    @property
    def state_address(self) -> int:
        """Where its state lies, for functions of its library that are not wrapped here."""
        return self._at_state

    def reset(self) -> None:
        """Back to the first state."""
        self._reset(self._at_state)

    def limit(self, commands: Sequence[float], speed: float = 1.0, rise: float = 1.0) -> None:
        """Limit the authority until `reset`: largest commands of slew, boom and stick, shares of the gate.

        `speed` is of its speed limits, `rise` of the rate at which commands may grow; all 0 to 1.  They are
        part of the state that `snapshot` copies.  Raises InputError for anything else.
        """
        values = np.array([*commands, speed, rise], dtype=float)
        if values.shape != (5,) or not np.all((values >= 0.0) & (values <= 1.0)):
            raise InputError(
                f"limited authority {values.tolist()}: three commands, speed and rise, each 0 to 1"
            )
        self._limit(self._at_state, values.ctypes.data)

    def restart(self, kept: Mapping[str, float]) -> None:
        """Back to the first state, with what was kept of the last run: a latched fault, the load.

        `kept`: `fault_code`, `fault_signal`, `load_estimate`, as far as they are known; others do not count.
        Raises InputError for one that cannot be.
        """
        fault, source, load = (
            kept.get(n, d) for n, d in (("fault_code", 0.0), ("fault_signal", 0.0), (LOAD, NONE))
        )
        for name, value in (("fault_code", fault), ("fault_signal", source), (LOAD, max(load, 0.0))):
            s = OUTPUT.signals[OUTPUT.at(name)]
            if not (s.min or 0.0) <= value <= (s.max or 0.0):
                raise InputError(
                    f"retained {name} = {value:g}: {s.min:g} to {s.max:g}; delete the retained values"
                )
        self._restart(self._at_state, int(fault), int(source), load)

    def snapshot(self) -> bytes:
        """The whole state, for `restore` of a core of the same bundle, on any platform."""
        return self._state.tobytes()

    def restore(self, snapshot: bytes) -> None:
        """Continue from a snapshot; InputError if it cannot be one of this core."""
        if len(snapshot) != self._state.nbytes:
            raise InputError(f"a snapshot of {len(snapshot)} bytes: this core's have {self._state.nbytes}")
        self._state[:] = np.frombuffer(snapshot, np.int64)

    @property
    def outputs(self) -> np.ndarray:
        """The image that every step writes."""
        return self._outputs

    @property
    def place(self) -> tuple[int, int, int]:
        """Address of the state and its bytes, and address of the output image: for C code."""
        return self._at_state, self._state.nbytes, self._at_outputs

    def ladder(self, inputs: np.ndarray, told: np.ndarray) -> None:
        """Which conditions of the state machine hold after a step (slr_ladder), for people; into `told`."""
        self._ladder(self._at(inputs), self._at_state, told.ctypes.data)

    def explained(self, inputs: np.ndarray, before: bytes) -> tuple[list[float], list[list[str]]]:
        """What was wanted of each axis (AXES) in the step just taken from the state `before`, and REASONS.

        Reasons are those that by themselves give what came out (runtime/core/explain.c).  Not for the cycle:
        for reports.
        """
        if len(before) < self._state.nbytes:
            raise InputError(f"a snapshot of {len(before)} bytes: this core's have {self._state.nbytes}")
        wanted, why = np.zeros(len(AXES)), np.zeros(len(AXES), np.int32)
        state = np.frombuffer(before[: self._state.nbytes], np.int64)
        places = (state.ctypes.data, self._at_state, wanted.ctypes.data, why.ctypes.data)
        self._explain(self._at(inputs), *places)
        reasons = [[name for bit, name in enumerate(REASONS) if bits >> bit & 1] for bits in why.tolist()]
        return wanted.tolist(), reasons

    def foreseen(self, inputs: np.ndarray, commands: Sequence[float]) -> np.ndarray:
        """Where the guard expects the machine at most, if `commands` were sent next and neutral ones then.

        From the inputs of the step that comes: lowest angles of slew, boom, stick, their highest [rad], twice
        the sine of half the tool's swing, and the room that is left [m] (runtime/core/guard.h).  Not for the
        cycle: for reports and tests.
        """
        sent, found = np.array(commands, dtype=float), np.zeros(FORESEEN)
        self._foresee(self._at(inputs), self._at_state, sent.ctypes.data, found.ctypes.data)
        return found

    def _check(self, library: ctypes.CDLL) -> None:
        path = self.bundle.folder / PARAMETERS
        for name in ("slr_layout", "slr_identity", "slr_parameters"):
            if not hasattr(library, name):
                raise InputError(
                    f"bundle {self.bundle.folder}: its core is of an older version; build it again"
                )
            getattr(library, name).restype = ctypes.c_char_p
        for name in ("slr_input_size", "slr_output_size", "slr_state_size"):
            getattr(library, name).restype = ctypes.c_size_t
        found = {
            "layout": (library.slr_layout().decode(), token()),
            "identity": (library.slr_identity().decode(), self.bundle.identity),
            f"parameters (SHA-256 of {PARAMETERS})": (library.slr_parameters().decode(), parameters_of(path)),
            "size of the input image": (library.slr_input_size(), INPUT.dtype.itemsize),
            "size of the output image": (library.slr_output_size(), OUTPUT.dtype.itemsize),
        }
        for what, (there, here) in found.items():
            if there != here:
                raise InputError(f"bundle {self.bundle.folder}: its core has {what} {there}, not {here}")
