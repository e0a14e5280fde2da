"""The FMU of beats3.c: its clocks tick at times that it tells, in co-simulation and scheduled execution."""

import functools
import tempfile
import zipfile
from pathlib import Path

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM
from tests.orchestrator.systems import HERE

FLAGS = (
    'hasEventMode="true" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUState="true" '
    'canSerializeFMUState="true"'
)
PARAMETERS = ("interval", "growth", "shift", "go", "qualifier", "fault")
STARTS = {"interval": "0.01", "qualifier": "-1"}
OUTPUTS = ("ticks", "last", "seen", "order", "heard", "heard_at", "pticks")


@functools.cache
def library() -> bytes:
    """The compiled library."""
    target = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        thing = Path(scratch) / "beats.o"
        compiler.compile_object(HERE / "beats3.c", thing, target.name, [f"-I{SHIM}"])
        return compiler.link_shared(
            [thing], Path(scratch) / f"beats{target.suffix}", target.name
        ).read_bytes()


def variables(k: str, p: str = "", priorities: tuple[int, int, int] = (0, 0, 0)) -> str:
    """ModelVariables: attributes of clock k, and of clock p, which is there only with some."""
    lines = [
        f'<Float64 name="{name}" valueReference="{vr}" causality="parameter" variability="fixed" '
        f'start="{STARTS.get(name, "0")}"/>'
        for vr, name in enumerate(PARAMETERS, 1)
    ]
    lines.append(
        '<Float64 name="period" valueReference="7" causality="parameter" variability="tunable" start="0"/>'
    )
    clock = '<Clock name="{}" valueReference="{}" causality="{}" priority="{}" intervalVariability={}/>'
    lines.append(clock.format("k", 10, "input", priorities[0], k))
    if p:
        lines.append(clock.format("p", 20, "input", priorities[1], p))
    lines.append(clock.format("i", 21, "input", priorities[2], '"triggered"'))
    lines.append('<Clock name="o" valueReference="12" causality="output" intervalVariability="triggered"/>')
    discrete = 'variability="discrete"'
    lines += [
        f'<Float64 name="u" valueReference="11" causality="input" {discrete} clocks="10" start="0"/>',
        f'<Float64 name="w" valueReference="22" causality="input" {discrete} clocks="21" start="0"/>',
        f'<Float64 name="y" valueReference="13" causality="output" {discrete} clocks="12"/>',
    ]
    lines += [
        f'<Float64 name="{name}" valueReference="{vr}" causality="output" {discrete}/>'
        for vr, name in enumerate(OUTPUTS, 30)
    ]
    lines.append('<Float64 name="x" valueReference="37" causality="output"/>')
    return "\n".join(lines)


def beats(
    folder: Path,
    k: str,
    p: str = "",
    kind: str = "CoSimulation",
    flags: str = FLAGS,
    priorities: tuple[int, int, int] = (0, 0, 0),
    name: str = "beats",
) -> Path:
    """The FMU; `k`, `p`: what stands in its clocks' elements after `intervalVariability=`."""
    target = compiler.host()
    path = folder / f"{name}.fmu"
    flags = flags if kind == "CoSimulation" else ""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            '<?xml version="1.0"?>\n<fmiModelDescription fmiVersion="3.0" modelName="beats" '
            'instantiationToken="x">'
            f'<{kind} modelIdentifier="beats" {flags}/><DefaultExperiment stepSize="0.02"/>'
            f"<ModelVariables>{variables(k, p, priorities)}</ModelVariables><ModelStructure/>"
            "</fmiModelDescription>",
        )
        archive.writestr(f"binaries/{target.name}/beats{target.suffix}", library())
    return path
