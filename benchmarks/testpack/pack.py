"""The pack on disk: a folder for each case, with its .ssp and what must come of it; a README of all."""

import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.testpack import kit, render
from benchmarks.testpack.case import SSD, Case, Package
from benchmarks.testpack.damage import DAMAGES, zipped

FMU = re.compile(r'"resources/([^"/]+)\.fmu"')
HEADER = """# A test pack for SSP importers

Small FMUs and systems: one for each feature of SSP and FMI co-simulation, and one for each error.
Made by `python -m benchmarks testpack`; `sources` holds the C code that all FMUs are compiled from (the
table of variables, `variables.h`, is generated for each).

Each folder holds `NAME.ssp` and what must come of it:

- `expected.csv`: the values at some times, to compare within the absolute tolerance stated below. The system
  is stepped with the constant step stated below, from 0 to the stop time. Tolerances are so wide that it
  does not matter whether a component sees the values of the begin or of the end of a step.
- or `expected.txt`: it must be refused before the first step, or must end with an error, and what the message
  must name.

Names are `component.variable`; every variable that is compared is also a connector of the system, called
`component_variable`. Names without a dot are connectors of the system.

Step sizes, algorithms and the like stand in annotations of the namespace `urn:slewright:simulation`, as SSP
does not define them. Cases marked with * are about these annotations: other importers may ignore them.
"""


def write(folder: Path, cases: Iterable[Case], targets: Sequence[str] = ()) -> list[Path]:
    """Write the pack; returns the paths of all its .ssp files.  `targets`: as in fmus.toolchain.compiler."""
    folder.mkdir(parents=True, exist_ok=True)
    chosen = list(cases)
    shutil.copytree(kit.SOURCES, folder / "sources", dirs_exist_ok=True)
    (folder / "README.md").write_text(readme(chosen), encoding="utf-8")
    return [write_case(folder / case.name, case, targets) for case in chosen]


def write_case(folder: Path, case: Case, targets: Sequence[str] = ()) -> Path:
    """The folder of one case; returns the path of its .ssp."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{case.name}.ssp"
    path.write_bytes(content(case, targets))
    if case.expect:
        (folder / "expected.csv").write_text(table(case), encoding="utf-8")
    else:
        (folder / "expected.txt").write_text(sentence(case) + "\n", encoding="utf-8")
    return path


def content(case: Case, targets: Sequence[str] = ()) -> bytes:
    """The bytes of the .ssp."""
    files = _files(case.package, case.fmi_version, targets)
    return DAMAGES[case.damage](files) if case.damage else zipped(files)


def _files(package: Package, fmi_version: int, targets: Sequence[str]) -> dict[str, bytes]:
    files = {SSD: render.for_version(package.ssd, fmi_version).encode()}
    for name, inner in package.files.items():
        if isinstance(inner, Package):
            files[name] = zipped(_files(inner, fmi_version, targets))
        elif isinstance(inner, str):
            files[name] = render.for_version(inner, fmi_version).encode()
        else:
            files[name] = inner
    texts = [package.ssd, *(f for f in package.files.values() if isinstance(f, str))]
    named = {name for text in texts for name in FMU.findall(text)}
    for name in sorted({*named, *package.fmus} - {"absent"}):
        files[f"resources/{name}.fmu"] = kit.build(name, fmi_version, targets).read_bytes()
    return files


# ---- what is expected, as text ----


def table(case: Case) -> str:
    """expected.csv."""
    times = case.checked_times
    columns = [times, *(case.values(name, times) for name in case.expect)]
    rows = [",".join(_number(column[i]) for column in columns) for i in range(len(times))]
    return "\n".join([",".join(["time", *case.expect]), *rows]) + "\n"


def _number(x: float | np.number) -> str:
    return f"{float(x):.12g}"


def sentence(case: Case) -> str:
    """What must come of a case without values."""
    named = [f"`{n}`" for n in case.names] + ([f"{SSD} line {case.line}"] if case.line else [])
    must = {
        "refused": "must be refused before the first step",
        "fails": "must end with an error",
        "ends": "must end before its stop time, without an error",
        "right": "must run",
    }[case.kind]
    return f"The system {must}" + (f"; the message must name {', '.join(named)}." if named else ".")


def readme(cases: Iterable[Case]) -> str:
    """README.md: all cases."""
    lines = [HEADER, "| case | what it is about | expected |", "| --- | --- | --- |"]
    for case in cases:
        what = _formulas(case) if case.expect else sentence(case)
        lines.append(f"| {case.name}{' *' * case.own} | {case.about} | {what} |")
    return "\n".join(lines) + "\n"


def _formulas(case: Case) -> str:
    values = "; ".join(f"`{name} = {formula}`" for name, formula in case.expect.items())
    at = f" at t = {', '.join(f'{t:g}' for t in case.times)}" if case.times else ""
    return f"{values}{at} ± {case.tolerance:g}, step {case.step_s:g} s to {case.stop_s:g} s"
