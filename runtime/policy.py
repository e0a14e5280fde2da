"""A control core whose policy onnxruntime evaluates: a second engine, for any ONNX file, without a compiler.

The core says when an answer is due and what the policy sees; the observation's history is kept here
(specs/policy.py), the answer is offered to the core before its step.  onnxruntime chooses its kernels by the
processor: its runs cannot be promised to replay bit for bit elsewhere, those of the native engine can.
"""

import ctypes
import json
from pathlib import Path
from typing import Any

import numpy as np

from runtime.bundle import ONNXRUNTIME, Bundle
from runtime.control import ControlCore
from runtime.image import INPUT, OUTPUT
from specs.errors import InputError
from specs.policy import (
    ACTIONS,
    INPUT as OBSERVATION,
    OUTPUT as ACTION,
    SENSORS,
    TARGETS,
    History,
    check_shapes,
    check_signals,
    read_contract,
)

POLICY, PARITY = "policy.onnx", "parity.json"
TOLERANCE = 1e-5  # of a command, between engines; float32 at both ends
DUE, STARTS = 1, 2  # slr_observe
COLUMNS = (*SENSORS, *ACTIONS)  # of a row of the history


def open_core(bundle: Bundle) -> ControlCore:
    """The core of a bundle with the engine that it names."""
    return PolicyCore(bundle) if bundle.engine == ONNXRUNTIME else ControlCore(bundle)


class Kept(History):
    """A history that can be written down."""

    def as_bytes(self) -> bytes:
        """Its rows, oldest first."""
        return np.array([[row[n] for n in COLUMNS] for row in self._rows]).tobytes()

    @classmethod
    def from_bytes(cls, length: int, data: bytes) -> "Kept":
        """The history that `as_bytes` wrote; InputError for bytes that cannot be one."""
        if len(data) % (8 * len(COLUMNS)) or len(data) // (8 * len(COLUMNS)) not in (0, length):
            raise InputError(f"a snapshot with {len(data)} bytes of history: another policy's")
        found = cls(length)
        rows = np.frombuffer(data).reshape(-1, len(COLUMNS)).tolist()
        found._rows = [dict(zip(COLUMNS, row, strict=True)) for row in rows]
        return found


class PolicyCore(ControlCore):
    """As ControlCore; a snapshot also holds the observation's history."""

    def __init__(self, bundle: Bundle, onnx: Path | None = None) -> None:
        """`onnx`: another policy of the same contract in the bundle's place.

        Raises InputError for a policy of another contract, or one whose answers in onnxruntime are not those
        that were computed when the bundle was built.
        """
        self._history = Kept()
        super().__init__(bundle)
        self._session, self._length = _session(onnx or bundle.folder / POLICY)
        if onnx is None:
            self._check_parity(bundle.folder / PARITY)
        self._history = Kept(self._length)
        size = len(INPUT.signals) + len(OUTPUT.signals)
        self._board, self._action = np.zeros(size), np.zeros(len(ACTIONS))
        self._at_board, self._at_action = self._board.ctypes.data, self._action.ctypes.data
        self._observe, self._offer = self.library.slr_observe, self.library.slr_offer
        self._observe.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
        self._offer.argtypes, self._offer.restype = [ctypes.c_void_p, ctypes.c_void_p], None

    def step(self, inputs: np.ndarray, tick: int) -> np.ndarray:
        """As ControlCore.step, the policy evaluated before it where it is due."""
        due = self._observe(self._at(inputs), self._at_state, self._at_board)
        if due:
            self._action[:] = self._asked(starts=due == STARTS)
            self._offer(self._at_state, self._at_action)
        return super().step(inputs, tick)

    def reset(self) -> None:
        """Back to the first state."""
        super().reset()
        self._history = Kept(self._history.length)

    def snapshot(self) -> bytes:
        """The core's state, then the history's rows."""
        return super().snapshot() + self._history.as_bytes()

    def restore(self, snapshot: bytes) -> None:
        """As ControlCore.restore."""
        size = self._state.nbytes
        super().restore(snapshot[:size])
        self._history = Kept.from_bytes(self._history.length, snapshot[size:])

    def answer(self, observation: np.ndarray) -> np.ndarray:
        """Commands [3] for an observation [N]."""
        given = {OBSERVATION: observation[None].astype(np.float32)}
        return np.asarray(self._session.run([ACTION], given)[0], dtype=np.float64)[0]

    def _asked(self, starts: bool) -> np.ndarray:
        board = self._board
        if starts:
            self._history = Kept(self._history.length)
        held = {n: 0.0 if starts else board[len(INPUT.signals) + OUTPUT.index[n]] for n in ACTIONS}
        self._history.push({n: board[INPUT.index[n]] for n in SENSORS}, held)
        seen = self._history.observation({n: float(board[INPUT.index[n]]) for n in TARGETS})
        return self.answer(np.array(seen))

    def _check_parity(self, path: Path) -> None:
        pairs = _pairs(path)
        for number, (observation, wanted) in enumerate(pairs):
            worst = float(np.max(np.abs(self.answer(observation) - wanted)))
            if not worst <= TOLERANCE:
                raise InputError(
                    f"{path.parent / POLICY}: in onnxruntime its answer {number} differs by {worst:.3g} from "
                    f"that of the native engine; at most {TOLERANCE:g} is allowed"
                )


def _pairs(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """Observations and what must be answered; InputError for a file without them."""
    try:
        found = json.loads(path.read_bytes())["pairs"]
        pairs = [(np.array(p["observation"], float), np.array(p["action"], float)) for p in found]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{path} holds no pairs of observations and answers") from None
    if not pairs or any(answer.shape != (len(ACTIONS),) or o.ndim != 1 for o, answer in pairs):
        raise InputError(f"{path} holds no pairs of observations and answers")
    return pairs


def _session(path: Path) -> tuple[Any, int]:
    """(onnxruntime session, history) of a policy; one thread, so that a tick has no company."""
    try:
        import onnxruntime as ort
    except ImportError:
        raise InputError(
            f"{path} needs onnxruntime (pip install 'slewright[learning]'), or the native engine"
        ) from None
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        session = ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - its own kinds: whatever is wrong with the file is wrong input
        raise InputError(f"{path} cannot be read by onnxruntime: {str(error).splitlines()[0]}") from None
    contract = read_contract(session.get_modelmeta().custom_metadata_map, str(path))
    ends = [{v.name: v.shape for v in found} for found in (session.get_inputs(), session.get_outputs())]
    check_shapes(ends[0], ends[1], contract, str(path))
    check_signals(contract, str(path))
    return session, contract.history
