"""A model description is read as it was written: variables, units, types, clocks, dependencies, terminals."""

import zipfile
from collections import Counter
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from orchestrator.fmi import terminals
from orchestrator.fmi.model_description import parse
from orchestrator.system.check import load_system
from orchestrator.system.overview import figures
from tests.orchestrator.beats import library
from tests.orchestrator.descriptions.definitions import Seen
from tests.orchestrator.descriptions.described import described

FEW, MANY = 400, 10_000
TO_THE_BIT = ("start", "min", "max", "nominal")  # 1, 1.0, True and -0.0 are told apart


def differences(seen: Seen) -> list[str]:
    """What the reader sees otherwise than it was written."""
    model = parse(seen.text, "x")
    wrong = [f"{key} = {getattr(model, key)!r}, not {value!r}" for key, value in seen.model.items()
             if getattr(model, key) != value]  # fmt: skip
    if list(model.variables) != list(seen.variables) and set(model.variables) != set(seen.variables):
        return [*wrong, f"variables {list(model.variables)}, not {list(seen.variables)}"]
    for name, expected in seen.variables.items():
        found = model.variables[name]
        for key, value in expected.items():
            got = getattr(found, key)
            got = got.__dict__ if key == "clock" and got is not None else got
            if got != value or (key in TO_THE_BIT and repr(got) != repr(value)):
                wrong.append(f"{name}.{key} = {got!r}, not {value!r}")
    for found, stated in (
        (model.dependencies, seen.dependencies),
        (model.initial_dependencies, seen.initial_dependencies),
    ):
        if set(found) != {n for n, v in seen.variables.items() if v["causality"] == "output"}:
            wrong.append(f"dependencies of {list(found)}")
        for name, inputs in stated.items():
            got = found[name]
            if (got is None) != (inputs is None) or set(got or ()) != set(inputs or ()):
                wrong.append(f"{name} depends on {got}, not {inputs}")
    return wrong


@pytest.mark.parametrize("version", [2, 3])
def test_descriptions_are_read_as_written(version: int) -> None:
    wrong = {seed: found for seed in range(FEW) if (found := differences(described(seed, version)))}
    assert not wrong, dict(list(wrong.items())[:3])


@pytest.mark.parametrize(
    ("key", "other"), [("start", 7.25), ("min", -3), ("unit_name", "q"), ("clocks", ("q",))]
)
def test_what_is_read_otherwise_is_noticed(key: str, other: object) -> None:
    seen = described(1, 3)
    name = next(iter(seen.variables))
    seen.variables[name][key] = other
    assert f"{name}.{key} = " in "".join(differences(seen))


@pytest.mark.long
@pytest.mark.parametrize("version", [2, 3])
def test_many_descriptions_are_read_as_written(version: int) -> None:
    wrong = {seed: found for seed in range(FEW, MANY) if (found := differences(described(seed, version)))}
    assert not wrong, dict(list(wrong.items())[:3])


def packed(folder: Path, seen: Seen) -> Path:
    target, path = compiler.host(), folder / "m.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", seen.text)
        archive.writestr(f"binaries/{target.name}/m{target.suffix}", library())
        if seen.terminal_text:
            archive.writestr(f"{terminals.FOLDER}/{terminals.FILE}", seen.terminal_text)
    return path


def ticks_anywhere(seen: Seen) -> bool:
    """Whether its clocks may tick inside steps, or have no times that would make them."""
    clocks = [v["clock"] for v in seen.variables.values() if v["clock"]]
    return seen.model["variable_step"] or not any(c["interval_s"] for c in clocks)


@pytest.mark.parametrize("seed", [n for n in range(60) if ticks_anywhere(described(n, 3))][:25])
def test_check_tells_what_was_written(tmp_path: Path, seed: int) -> None:
    seen = described(seed, 3)
    path = packed(tmp_path, seen)
    found = figures(load_system(path))["components"][0]
    causalities = Counter(v["causality"] for v in seen.variables.values())
    assert [found[f"{name}s"] for name in ("input", "output", "parameter")] == [
        causalities[name] for name in ("input", "output", "parameter")
    ]
    assert found["types"] == Counter(v["type"] for v in seen.variables.values())
    assert found["arrays"] == sum(bool(v["dimensions"]) for v in seen.variables.values())
    assert found["log_categories"] == seen.model.get("log_categories", {})
    assert {t["name"]: t["members"] for t in found["terminals"]} == seen.terminals
    clocks = {n: v["clock"] for n, v in seen.variables.items() if v["clock"]}
    assert {c["name"]: c["interval"] for c in found["clocks"]} == {
        n: c["interval_variability"] for n, c in clocks.items()
    }
