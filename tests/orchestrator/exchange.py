"""Builds the FMUs of exchange2.c and exchange3.c: model exchange; what they compute is in exchange.h."""

import functools
import tempfile
from pathlib import Path

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack

HERE = Path(__file__).parent
OSCILLATOR, BALL, ENDLESS, BROKEN, STAIR, LAG, CHATTER, WATCHED, PAST = range(9)
# name, value reference, causality, variability, further attributes; the last two are whole numbers
VARIABLES = (
    ("time", 0, "independent", "continuous", {}),
    ("x", 1, "output", "continuous", {"start": "2", "initial": "exact"}),
    ("der(x)", 2, "local", "continuous", {"derivative": "x"}),
    ("v", 3, "output", "continuous", {"start": "0", "initial": "exact"}),
    ("der(v)", 4, "local", "continuous", {"derivative": "v"}),
    ("u", 5, "input", "continuous", {"start": "0"}),
    ("mu", 6, "parameter", "fixed", {"start": "1"}),
    ("y", 7, "output", "continuous", {}),
    ("kind", 8, "parameter", "fixed", {"start": "0"}),
    ("count", 9, "output", "discrete", {}),
)


def exchange(fmi_version: int, folder: Path, kind: int = OSCILLATOR) -> Path:
    """The FMU; `kind`: the start value of its parameter."""
    host = compiler.host()
    binaries = host.fmi2_folder if fmi_version == 2 else host.name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "exchange.fmu"
    content = {
        "modelDescription.xml": description(fmi_version, kind).encode(),
        f"binaries/{binaries}/exchange{host.suffix}": library(fmi_version),
    }
    path.write_bytes(pack(content))
    return path


@functools.cache
def library(fmi_version: int) -> bytes:
    """Its shared library."""
    host = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made = folder / "exchange.o"
        flags = (f"-I{SHIM}", f"-I{HERE}", "-fvisibility=default")
        compiler.compile_object(HERE / f"exchange{fmi_version}.c", made, host.name, flags)
        return compiler.link_shared([made], folder / f"exchange{host.suffix}", host.name).read_bytes()


def description(fmi_version: int, kind: int) -> str:
    """Its modelDescription.xml."""
    state = "canGetAndSetFMUstate" if fmi_version == 2 else "canGetAndSetFMUState"
    variables = "\n".join(_variable(fmi_version, kind, *variable) for variable in VARIABLES)
    token = "guid" if fmi_version == 2 else "instantiationToken"
    root = f'fmiVersion="{fmi_version}.0" modelName="exchange" {token}="exchange"'
    root += ' numberOfEventIndicators="1"' * (fmi_version == 2)
    return (
        f'<?xml version="1.0"?>\n<fmiModelDescription {root}>\n'
        f'<ModelExchange modelIdentifier="exchange" {state}="true"/>\n'
        f'<DefaultExperiment stopTime="3" stepSize="0.01" tolerance="1e-6"/>\n'
        f"<ModelVariables>\n{variables}\n</ModelVariables>\n{_structure(fmi_version)}\n</fmiModelDescription>\n"
    )


def _variable(
    fmi_version: int, kind: int, name: str, vr: int, causality: str, variability: str, more: dict[str, str]
) -> str:
    more = {**more, "start": str(kind)} if name == "kind" else dict(more)
    if fmi_version == 3:
        more = {k: {"x": "1", "v": "3"}[v] if k == "derivative" else v for k, v in more.items()}
        type_ = "Int32" if vr > 7 else "Float64"
        attributes = "".join(f' {key}="{value}"' for key, value in more.items())
        return (
            f'<{type_} name="{name}" valueReference="{vr}" causality="{causality}" '
            f'variability="{variability}"{attributes}/>'
        )
    initial = f' initial="{more.pop("initial")}"' if "initial" in more else ""
    more = {k: {"x": "2", "v": "4"}[v] if k == "derivative" else v for k, v in more.items()}
    attributes = "".join(f' {key}="{value}"' for key, value in more.items())
    type_ = "Integer" if vr > 7 else "Real"
    return (
        f'<ScalarVariable name="{name}" valueReference="{vr}" causality="{causality}" '
        f'variability="{variability}"{initial}><{type_}{attributes}/></ScalarVariable>'
    )


def _structure(fmi_version: int) -> str:
    if fmi_version == 3:
        outputs = "".join(f'<Output valueReference="{vr}"/>' for vr in (1, 3, 7, 9))
        rates = "".join(f'<ContinuousStateDerivative valueReference="{vr}"/>' for vr in (2, 4))
        return f'<ModelStructure>{outputs}{rates}<EventIndicator valueReference="1"/></ModelStructure>'
    outputs = "".join(f'<Unknown index="{i}"/>' for i in (2, 4, 8, 10))
    rates = "".join(f'<Unknown index="{i}"/>' for i in (3, 5))
    return f"<ModelStructure><Outputs>{outputs}</Outputs><Derivatives>{rates}</Derivatives></ModelStructure>"
