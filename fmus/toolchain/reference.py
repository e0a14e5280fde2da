"""What an FMU of ours must compute, carried in itself (FMI-LS-REF): inputs, outputs and their tolerance.

The inputs step through a part of their ranges; the outputs are those of the FMU's own machine code, run
here through FMI 2.0.  They are the same bits on every platform, and so are these files.
"""

import ctypes
import hashlib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fmus.definition import Model, Variable
from fmus.toolchain import compiler
from fmus.toolchain.variables import SEED_VR, exposed
from specs.errors import RunError

FOLDER = "extra/org.fmi-standard.fmi-ls-ref/"
DURATION_S, MOST_STEPS = 4.0, 20_000  # of the experiment; a model of very short steps gets less
PIECES, ROWS = 8, 40  # sets of inputs, rows of outputs; at least a step each
SHARE = 0.1  # of an input's range, and no more than OF_NOMINAL, to both sides of its start
OF_NOMINAL = 0.3
WITHOUT_RANGE = 0.1  # the same for an input that states neither, in its unit
TOLERANCE = 1e-6  # of a signal's largest value; the rows have nine digits
SEED = 1  # of the sensors' noise
GOLDEN = 0.6180339887498949  # its multiples fill an interval evenly

_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
    fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1"
    fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">
  <Related type="application/xml" source="experiments.xml" role="experiment/smoke-test"
      description="Inputs, and the outputs that must come of them" checksum="{checksum}"/>
</fmiReferences>
"""
_EXPERIMENTS = """<?xml version="1.0" encoding="UTF-8"?>
<Experiments>
  <Experiment name="steps" description="Steps of all inputs" startTime="0" stopTime="{stop:.9g}"
      stepSize="{step:.9g}" tolerance="{tolerance:.9g}">
{parts}  </Experiment>
</Experiments>
"""
_PARAMETERS = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    version="1.0" name="{name}">
  <ssv:Parameters>
    <ssv:Parameter name="{name}"><ssv:{kind} value="{value}"/></ssv:Parameter>
  </ssv:Parameters>
</ssv:ParameterSet>
"""


@dataclass(frozen=True)
class Steps:
    """`count` steps of `step_s` seconds; new inputs every `held` steps, a row every `shown` steps."""

    step_s: float
    count: int
    held: int
    shown: int


def files(model: Model, library: bytes, token: str) -> dict[str, bytes]:
    """FMI-LS-REF's files by their place in the archive; `library`: of FMI 2.0, for this machine.

    Empty for a model without outputs, or one that fails before the first row after its start.
    """
    steps = _steps(model)
    pieces = [_inputs(model, k) for k in range(steps.count // steps.held + 1)]
    with _Running(model, library, token) as running:
        rows = running.rows(steps, pieces)
    if not model.outputs or len(rows) < 2:
        return {}
    seeded = any(e.vr == SEED_VR for e in exposed(model))
    return _content(model, steps, pieces, rows, parameter("noise_seed", "Integer", SEED) if seeded else "")


def parameter(name: str, kind: str, value: object) -> str:
    """A parameter set (SSV) with one value, of a type of SSP."""
    return _PARAMETERS.format(name=name, kind=kind, value=value)


def _content(
    model: Model,
    steps: Steps,
    pieces: Sequence[Sequence[float]],
    rows: Sequence[tuple[int, Sequence[float]]],
    parameters: str,
) -> dict[str, bytes]:
    """FMI-LS-REF's files by their place in the archive; `rows`: numbers of rows, and outputs then."""
    shown_s = steps.shown * steps.step_s
    results = table(model.outputs, [(k * shown_s, row) for k, row in rows])
    stop = rows[-1][0] * shown_s
    return carried(parameters, _stimuli(model, steps, pieces), results, stop, steps.step_s)


def carried(parameters: str, stimuli: str, results: str, stop: float, step: float) -> dict[str, bytes]:
    """FMI-LS-REF's files by their place in the archive, of one experiment; "": none of that."""
    texts = {"parameters.ssv": parameters, "inputs.csv": stimuli, "outputs.csv": results}
    texts["experiments.xml"] = text = _experiments(texts, stop, step)
    texts["fmi-ls-manifest.xml"] = _MANIFEST.format(checksum=hashlib.sha3_256(text.encode()).hexdigest())
    return {FOLDER + name: text.encode() for name, text in texts.items() if text}


def _steps(model: Model) -> Steps:
    step = max(model.step, model.sample_time)
    duration = min(DURATION_S, MOST_STEPS * step)
    held, shown = (max(1, round(duration / n / step)) for n in (PIECES, ROWS))
    return Steps(step, held * PIECES, held, shown)


def _inputs(model: Model, piece: int) -> list[float]:
    """Values of all inputs in a piece; the first piece is at rest."""
    return [
        _within(v, 2.0 * ((piece * (i + 1) * GOLDEN) % 1.0) - 1.0 if piece else 0.0)
        for i, v in enumerate(model.inputs)
    ]


def _within(v: Variable, part: float) -> float:
    """The start value moved by `part` (-1..1) of what is allowed."""
    low, high = v.min, v.max
    sizes = [] if v.nominal is None else [OF_NOMINAL * v.nominal]
    sizes += [] if low is None or high is None else [SHARE * (high - low)]
    size = min(sizes, default=WITHOUT_RANGE)
    value = float(f"{v.start + part * size:.6g}")
    value = value if low is None else max(low, value)
    return value if high is None else min(high, value)


def _stimuli(model: Model, steps: Steps, pieces: Sequence[Sequence[float]]) -> str:
    """Two rows where a piece begins: a step, also to readers that connect rows by lines."""
    if not model.inputs:
        return ""
    rows = [(0.0, pieces[0])]
    for k in range(1, len(pieces)):
        time = k * steps.held * steps.step_s
        rows += [(time, pieces[k - 1]), (time, pieces[k])]
    return table(model.inputs, rows)


def table(columns: Sequence[Variable], rows: Sequence[tuple[float, Sequence[float]]]) -> str:
    """CSV over time, in nine digits."""
    head = ",".join(("time", *(v.name for v in columns)))
    lines = (",".join((f"{time:.9g}", *(f"{x:.9g}" for x in values))) for time, values in rows)
    return "\n".join((head, *lines)) + "\n"


def _experiments(content: dict[str, str], stop: float, step: float) -> str:
    parts = {"Parameters": "parameters.ssv", "Stimuli": "inputs.csv", "References": "outputs.csv"}
    given = "".join(f'    <{tag} source="{name}"/>\n' for tag, name in parts.items() if content[name])
    return _EXPERIMENTS.format(stop=stop, step=step, tolerance=TOLERANCE, parts=given)


class _Running:
    """An instance of an FMI 2.0 library, for as long as it is needed; its messages are not kept."""

    def __init__(self, model: Model, library: bytes, token: str) -> None:
        self._token = token.encode()
        self._vrs = {e.group + e.name: e.vr for e in exposed(model)}
        self._model = model
        self._folder = tempfile.TemporaryDirectory()
        path = Path(self._folder.name) / f"{hashlib.sha256(library).hexdigest()[:16]}{compiler.host().suffix}"
        path.write_bytes(library)
        self._library = ctypes.CDLL(str(path))

    def __enter__(self) -> "_Running":
        instantiate = self._library.fmi2Instantiate
        instantiate.restype = ctypes.c_void_p
        self._callbacks = (ctypes.c_void_p * 5)()  # neither logger nor memory: the shim needs none
        found = instantiate(b"reference", 1, self._token, b"", self._callbacks, 0, 0)
        if not found:
            raise RunError(f"model {self._model.name}: its library makes no instance")
        self._instance = ctypes.c_void_p(found)
        return self

    def __exit__(self, *_: object) -> None:
        self._library.fmi2FreeInstance(self._instance)
        _unload(self._library)
        self._folder.cleanup()

    def rows(self, steps: Steps, pieces: Sequence[Sequence[float]]) -> list[tuple[int, list[float]]]:
        """(Number of the row, outputs), as far as the model comes."""
        if self._begin(pieces[0]):
            return []
        found = []
        for k in range(steps.count + 1):
            if k % steps.shown == 0:
                found.append((k // steps.shown, self._outputs()))
            if k % steps.held == 0:
                self._set(pieces[k // steps.held])
            time, size = ctypes.c_double(k * steps.step_s), ctypes.c_double(steps.step_s)
            if self._library.fmi2DoStep(self._instance, time, size, 1):
                break
        return found

    def _begin(self, inputs: Sequence[float]) -> bool:
        """Initialised with the first inputs; whether that failed."""
        zero = ctypes.c_double(0.0)
        self._library.fmi2SetupExperiment(self._instance, 0, zero, zero, 0, zero)
        self._library.fmi2EnterInitializationMode(self._instance)
        if "SEEDnoise_seed" in self._vrs:
            self._library.fmi2SetInteger(
                self._instance, (ctypes.c_uint * 1)(SEED_VR), ctypes.c_size_t(1), (ctypes.c_int * 1)(SEED)
            )
        self._set(inputs)
        return bool(self._library.fmi2ExitInitializationMode(self._instance))

    def _set(self, values: Sequence[float]) -> None:
        vrs = [self._vrs["INPUT" + v.name] for v in self._model.inputs]
        count, numbers = len(vrs), (ctypes.c_double * len(vrs))(*values)
        self._library.fmi2SetReal(
            self._instance, (ctypes.c_uint * count)(*vrs), ctypes.c_size_t(count), numbers
        )

    def _outputs(self) -> list[float]:
        vrs = [self._vrs["OUTPUT" + v.name] for v in self._model.outputs]
        count, numbers = len(vrs), (ctypes.c_double * len(vrs))()
        self._library.fmi2GetReal(
            self._instance, (ctypes.c_uint * count)(*vrs), ctypes.c_size_t(count), numbers
        )
        return list(numbers)


def _unload(library: ctypes.CDLL) -> None:
    """Let go of a library, so that its file can be removed."""
    import _ctypes

    free = "FreeLibrary" if os.name == "nt" else "dlclose"
    getattr(_ctypes, free)(library._handle)
