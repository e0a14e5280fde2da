"""The benchmark's system: three trivial C FMUs in a chain, built here with the same flags for every master.

    a.y → b.u, b.y → c.u; logged: a.y, b.y, c.y, c.rate

For FMI 2 and FMI 3: three FMU files, an SSP, an SSP that shows every variable, and the C driver (c/drive.c).
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from benchmarks.orchestrator.masters import Case
from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD, SHIM, pack as pack_zip
from orchestrator.system.pack import pack

SOURCES = Path(__file__).parent / "c"
NAMES = ("a", "b", "c")
STEP_S = 0.01
SIGNALS = [("a", "y"), ("b", "y"), ("c", "y"), ("c", "rate")]
LOGGED = [f"{component}.{variable}" for component, variable in SIGNALS]
LINKS = (("a", "b"), ("b", "c"))  # y to u
VARIABLES = {"u": (0, "input"), "y": (1, "output"), "rate": (2, "output")}
COLUMNS = 1 + len(NAMES) * len(VARIABLES)  # time and all variables
LINUX_LIBRARIES = ("-Wl,--no-as-needed", "-ldl")


@dataclass(frozen=True)
class Chain:
    """What a master needs: FMU files by component, their libraries, both SSPs, the C driver."""

    fmi_version: int
    folder: Path
    driver: Path

    @property
    def fmus(self) -> dict[str, Path]:
        return {name: self.folder / f"{name}.fmu" for name in NAMES}

    @property
    def libraries(self) -> list[Path]:
        suffix = compiler.host().suffix
        return [self.folder / f"{name}{suffix}" for name in NAMES]

    @property
    def ssp(self) -> Path:
        """Only what the chain needs is a connector."""
        return self.folder / "chain.ssp"

    @property
    def whole_ssp(self) -> Path:
        """Every variable of every FMU but the first input is a connector."""
        return self.folder / "whole.ssp"


def build(fmi_version: int, out: Path | None = None) -> Chain:
    """Build the chain for FMI 2 or 3, or find it built."""
    chain = Chain(fmi_version, (out or BUILD / "bench") / _key() / f"fmi{fmi_version}", Path())
    chain = Chain(fmi_version, chain.folder, chain.folder.parent / f"drive{compiler.host().suffix}")
    if not chain.whole_ssp.is_file():  # written last
        chain.folder.mkdir(parents=True, exist_ok=True)
        _compile(["drive"], chain.driver, LINUX_LIBRARIES)
        _build_fmus(chain)
        for path, whole in ((chain.ssp, False), (chain.whole_ssp, True)):
            pack(_ssd(fmi_version, whole), {f"{n}.fmu": f for n, f in chain.fmus.items()}, path)
    return chain


def _key() -> str:
    digest = hashlib.sha256(repr(compiler.FLAGS).encode() + compiler.identity(compiler.host().name).encode())
    for path in (*sorted(SOURCES.iterdir()), Path(__file__)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _compile(sources: list[str], out: Path, libraries: tuple[str, ...] = ()) -> None:
    host = compiler.host().name
    objects = []
    for name in sources:
        target = out.parent / f"{out.stem}-{name}.o"
        objects.append(compiler.compile_object(SOURCES / f"{name}.c", target, host, [f"-I{SHIM}"]))
    compiler.link_shared(objects, out, host, libraries if host.endswith("linux") else ())
    for target in objects:
        target.unlink()


def _build_fmus(chain: Chain) -> None:
    """Three libraries and three archives: no master loads one library for three components."""
    host, version = compiler.host(), chain.fmi_version
    folder = host.fmi2_folder if version == 2 else host.name
    description = (_description2() if version == 2 else _description3()).encode()
    for name, library in zip(NAMES, chain.libraries, strict=True):
        _compile([f"link{version}", f"unsupported{version}"], library)
        files = {
            "modelDescription.xml": description,
            f"binaries/{folder}/link{host.suffix}": library.read_bytes(),
        }
        chain.fmus[name].write_bytes(pack_zip(files))


def _description2() -> str:
    variables = "\n".join(
        f'<ScalarVariable name="{name}" valueReference="{vr}" causality="{kind}" variability="continuous"'
        f'{_exact(kind)}><Real start="{_start(name)}"/></ScalarVariable>'
        for name, (vr, kind) in VARIABLES.items()
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="link" guid="link" numberOfEventIndicators="0">
<CoSimulation modelIdentifier="link" canHandleVariableCommunicationStepSize="true"
 canNotUseMemoryManagementFunctions="true"/>
<ModelVariables>
{variables}
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2" dependencies=""/><Unknown index="3" dependencies=""/></Outputs>
</ModelStructure></fmiModelDescription>
"""


def _description3() -> str:
    variables = "\n".join(
        f'<Float64 name="{name}" valueReference="{vr}" causality="{kind}" variability="continuous"'
        f'{_exact(kind)} start="{_start(name)}"/>'
        for name, (vr, kind) in VARIABLES.items()
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="link" instantiationToken="link">
<CoSimulation modelIdentifier="link" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
{variables}
<Float64 name="time" valueReference="3" causality="independent" variability="continuous"/>
</ModelVariables>
<ModelStructure><Output valueReference="1" dependencies=""/><Output valueReference="2" dependencies=""/>
</ModelStructure></fmiModelDescription>
"""


def _exact(kind: str) -> str:
    return "" if kind == "input" else ' initial="exact"'


def _start(name: str) -> str:
    return "0.5" if name == "u" else "0"


def _ssd(fmi_version: int, whole: bool) -> str:
    # FMPy wants every input that is a connector to be connected, so a.u is none.
    if whole:
        shown = {"a": ("y", "rate"), "b": ("u", "y", "rate"), "c": ("u", "y", "rate")}
    else:
        shown = {"a": ("y",), "b": ("u", "y"), "c": ("u", "y", "rate")}
    real = "Real" if fmi_version == 2 else "Float64"
    components = []
    for name in NAMES:
        connectors = "".join(
            f'<ssd:Connector name="{v}" kind="{VARIABLES[v][1]}"><ssc:{real}/></ssd:Connector>'
            for v in shown[name]
        )
        components.append(
            f'<ssd:Component name="{name}" source="resources/{name}.fmu">'
            f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
        )
    connections = "".join(
        f'<ssd:Connection startElement="{a}" startConnector="y" endElement="{b}" endConnector="u"/>'
        for a, b in LINKS
    )
    version = "1.0" if fmi_version == 2 else "2.0"
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="{version}" name="chain">
<ssd:System name="chain"><ssd:Elements>
{chr(10).join(components)}
</ssd:Elements><ssd:Connections>{connections}</ssd:Connections></ssd:System>
<ssd:DefaultExperiment startTime="0" stopTime="1"/>
<ssd:Annotations><ssc:Annotation type="slewright.simulation">
<slw:Simulation xmlns:slw="urn:slewright:simulation" stepSize="{STEP_S}"/></ssc:Annotation></ssd:Annotations>
</ssd:SystemStructureDescription>
"""


def case(chain: Chain, folder: Path) -> Case:
    """The chain as other masters are told it, with `folder` to work in."""
    return Case(
        fmi_version=chain.fmi_version,
        step_s=STEP_S,
        folder=folder,
        files=chain.fmus,
        links=[((a, "y"), (b, "u")) for a, b in LINKS],
        outputs=SIGNALS,
        vr={(c, v): vr for c in NAMES for v, (vr, _) in VARIABLES.items()},
    )
