"""Runs the class of an FMU for shim.c, which started this process: requests and answers over descriptor 3.

Stands alone: it is packed into FMUs and needs nothing but Python (and what the class imports).
"""

import importlib.util
import json
import pickle
import socket
import struct
import sys
import traceback
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent


class Runner:
    """The object, and its variables in the order of the cells: time first."""

    def __init__(self):
        self.table = json.loads((HERE / "table.json").read_text(encoding="utf-8"))
        spec = importlib.util.spec_from_file_location("model", HERE / "model" / self.table["file"])
        if spec is None or spec.loader is None:
            raise ImportError(f"{self.table['file']} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules["model"] = module  # so that its objects can be pickled
        sys.path.insert(0, str(HERE / "model"))
        spec.loader.exec_module(module)
        self.made = getattr(module, self.table["class"])
        self.object: Any = None

    def load(self, _):
        """A new object."""
        self.object = self.made()
        return b""

    def begin(self, request):
        """After the start values are set."""
        time, _, *cells = struct.unpack(f"={len(request) // 8}d", request)
        self.set(cells, ("input", "parameter", "output"))
        if hasattr(self.object, "start"):
            self.object.start()
        return self.outputs(time, cells)

    def step(self, request):
        """One step."""
        time, h, *cells = struct.unpack(f"={len(request) // 8}d", request)
        self.set(cells, ("input", "parameter"))
        self.object.step(time, h)
        return self.outputs(time + h, cells)

    def keep(self, _):
        """The state."""
        return pickle.dumps(self.object.__dict__)

    def back(self, request):
        """Back to a state."""
        self.object.__dict__.clear()
        self.object.__dict__.update(pickle.loads(request))
        return b""

    def set(self, cells, causalities):
        for v in self.table["variables"]:
            if v["causality"] in causalities:
                kind = {"d": float, "i": int, "b": bool}[v["kind"]]
                values = [kind(x) for x in self.part(v, cells)]
                setattr(self.object, v["name"], self.array(v, values) if v["array"] else values[0])

    def outputs(self, time, cells):
        cells[0] = time
        for v in self.table["variables"]:
            if v["causality"] == "output":
                values = numbers(v, getattr(self.object, v["name"]))
                cells[v["first"] : v["first"] + v["size"]] = values
        return struct.pack(f"={len(cells)}d", *cells)

    @staticmethod
    def part(variable, cells):
        return cells[variable["first"] : variable["first"] + variable["size"]]

    @staticmethod
    def array(variable, values):
        if variable["array"] == "list":
            return values
        import numpy

        return numpy.array(values)


def numbers(variable, value):
    """The numbers of an output; what has another form is said with the variable's name."""
    name, size = variable["name"], variable["size"]
    try:
        given = list(value) if variable["array"] else [value]
        if any(isinstance(x, (str, bytes)) for x in given):
            raise TypeError("a text")
        values = [float(x) for x in given]
    except (TypeError, ValueError):
        wanted = f"an array of {size} numbers" if variable["array"] else "a number"
        raise TypeError(f"output {name} must be {wanted}, not {value!r:.80}") from None
    if len(values) != size:
        raise ValueError(f"output {name} has {len(values)} elements, not {size}")
    if variable["kind"] == "i" and not (-(2**31) <= values[0] < 2**31 and values[0] == int(values[0])):
        raise ValueError(f"output {name} is {value!r:.80}, no whole number of 32 bits")
    return values


def words(error):
    """What was raised and where in the class's file."""
    lines = [f for f in traceback.extract_tb(error.__traceback__) if f.filename != __file__]
    where = f" ({Path(lines[-1].filename).name} line {lines[-1].lineno})" if lines else ""
    return f"{type(error).__name__}: {error}{where}"


def take(connection, size):
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            sys.exit(0)  # the FMU was freed
        data += part
    return data


def main():
    connection, runner = socket.socket(fileno=3), None
    while True:
        what = take(connection, 1)
        (size,) = struct.unpack("=I", take(connection, 4))
        request = take(connection, size)
        try:
            runner = runner or Runner()
            does = {
                b"L": runner.load,
                b"I": runner.begin,
                b"S": runner.step,
                b"G": runner.keep,
                b"P": runner.back,
            }
            status, answer = 0, does[what](request)
        except (Exception, SystemExit) as error:  # noqa: BLE001  # whatever the class raises
            status, answer = 1, words(error).encode()
        connection.sendall(struct.pack("=II", status, len(answer)) + answer)


main()
