"""FMPy's instances of our FMUs behind one small interface for both FMI versions, for tests only."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

STEP = 0.02


class Imported:
    """An instance in step mode (after `start`); a context manager that frees it."""

    def __init__(self, path: Path, seed: int | None = None, **start: float) -> None:
        self.description: Any = fmpy.read_model_description(str(path))
        self.vr = {v.name: v.valueReference for v in self.description.modelVariables}
        self.folder = fmpy.extract(str(path))
        self.version = int(self.description.fmiVersion[0])
        maker = FMU2Slave if self.version == 2 else FMU3Slave
        self.fmu: Any = maker(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )
        self.fmu.instantiate()
        self.time = 0.0
        self.initialise(seed, start)

    def initialise(self, seed: int | None, start: Mapping[str, float]) -> None:
        if self.version == 2:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        if seed is not None:
            self.set_seed(seed)
        self.set(**start)
        self.fmu.exitInitializationMode()

    def set_seed(self, seed: int) -> None:
        setter = self.fmu.setInteger if self.version == 2 else self.fmu.setInt32
        setter([self.vr["noise_seed"]], [seed])

    def set(self, **values: float) -> None:
        setter = self.fmu.setReal if self.version == 2 else self.fmu.setFloat64
        setter([self.vr[n] for n in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        getter = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        return list(getter([self.vr[n] for n in names]))

    def step(self, size: float = STEP) -> None:
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def run(self, steps: int, inputs: Mapping[str, float], outputs: list[str]) -> list[list[float]]:
        """`steps` steps with constant inputs, and the outputs after each."""
        rows = []
        self.set(**inputs)
        for _ in range(steps):
            self.step()
            rows.append(self.get(*outputs))
        return rows

    def saved(self) -> bytes:
        """The serialised FMU state."""
        if self.version == 2:
            state = self.fmu.getFMUstate()
            data = self.fmu.serializeFMUstate(state)
            self.fmu.freeFMUstate(state)
        else:
            state = self.fmu.getFMUState()
            data = self.fmu.serializeFMUState(state)
            self.fmu.freeFMUState(state)
        return bytes(data)

    def restore(self, data: bytes) -> None:
        if self.version == 2:
            state = self.fmu.deSerializeFMUstate(data)
            self.fmu.setFMUstate(state)
            self.fmu.freeFMUstate(state)
        else:
            state = self.fmu.deserializeFMUState(data)
            self.fmu.setFMUState(state)
            self.fmu.freeFMUState(state)

    def derivative(self, unknown: str, known: str) -> float:
        pair = ([self.vr[unknown]], [self.vr[known]], [1.0])
        return float(self.fmu.getDirectionalDerivative(*pair)[0])

    def __enter__(self) -> "Imported":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)
