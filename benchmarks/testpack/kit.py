"""Compiles the FMUs of the pack from c/ and packs them, once for each content."""

import hashlib
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.testpack.description import description, terminals, token_begin
from benchmarks.testpack.models import NAMES, Fmu, Variable, fmu as fmu_named
from fmus.toolchain import compiler
from fmus.toolchain.build import BUILD, SHIM, pack as pack_zip

SOURCES = Path(__file__).parent / "c"
OUT = BUILD / "testpack"
FILES = {2: ("models", "fmi2"), 3: ("models", "fmi3", "unsupported3")}
EXCHANGE = {2: "exchange2", 3: "exchange3"}  # besides, for model exchange
TEXTS = ("String", "Binary")


def build(name: str, fmi_version: int, targets: Sequence[str] = ()) -> Path:
    """Path of an FMU of the pack, built for this platform (or `targets`) if it is not there yet.

    Raises KeyError for an unknown name, InputError without a C compiler.
    """
    fmu = fmu_named(name, fmi_version)
    names = tuple(targets) or (compiler.host().name,)
    path = OUT / _key(fmu, fmi_version, names) / f"{name}.fmu"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        files = {"modelDescription.xml": description(fmu, fmi_version).encode()}
        if fmu.terminals:
            files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals(fmu).encode()
        for target in map(compiler.target, names):
            folder = target.fmi2_folder if fmi_version == 2 else target.name
            binary = f"binaries/{folder}/{fmu.model}{target.suffix}"
            files[binary] = library(fmu, fmi_version, target).read_bytes()
        part = Path(tempfile.mkstemp(dir=path.parent)[1])
        part.write_bytes(pack_zip(files))
        part.replace(path)
    return path


def library(fmu: Fmu, fmi_version: int, target: compiler.Target) -> Path:
    """The shared library: one for all FMUs that differ in their descriptions only."""
    header = variables_header(fmu, fmi_version)
    digest = hashlib.sha256(f"{header}{target.name}{_sources()}".encode()).hexdigest()[:16]
    path = OUT / "libraries" / f"{fmu.model}{fmi_version}-{digest}{target.suffix}"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        _compile(fmu, fmi_version, target, header, path)
    return path


def _compile(fmu: Fmu, fmi_version: int, target: compiler.Target, header: str, path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
        folder = Path(scratch)
        (folder / "variables.h").write_text(header)
        flags = [f"-I{SHIM}", f"-I{folder}", f"-DKIT_{fmu.model}", f"-DKIT_FMI{fmi_version}"]
        flags += ["-DKIT_EXCHANGE"] if fmu.exchange else []
        flags.append(f'-DKIT_TOKEN="{token_begin(fmu, fmi_version)}"')
        objects = [
            compiler.compile_object(SOURCES / f"{n}.c", folder / f"{n}.o", target.name, flags)
            for n in (*FILES[fmi_version], *([EXCHANGE[fmi_version]] if fmu.exchange else []))
        ]
        compiler.link_shared(objects, folder / path.name, target.name).replace(path)


def _sources() -> str:
    flags = repr(compiler.FLAGS) + compiler.identity(compiler.host().name)
    return flags + "".join(p.read_text() for p in sorted(SOURCES.iterdir()))


def _key(fmu: Fmu, fmi_version: int, names: tuple[str, ...]) -> str:
    text = (
        description(fmu, fmi_version)
        + terminals(fmu)
        + variables_header(fmu, fmi_version)
        + repr(names)
        + _sources()
    )
    return hashlib.sha256(text.encode()).hexdigest()[:16]


# ---- variables.h ----


def variables_header(fmu: Fmu, fmi_version: int) -> str:
    """The table of variables in C: where each stands, and what it starts with."""
    first, texts, cells = _places(fmu)
    rows = [
        f"  {{{_kind(v, fmi_version)}, {first[v.name]}, {v.size if isinstance(v.size, int) else v.most}, "
        f"{first[v.size] if isinstance(v.size, str) else -1}}},"
        for v in fmu.variables
    ]
    starts = [line for v in fmu.variables for line in _starts(v, first[v.name])]
    text_starts = [
        f'{{{len(_content(v))}, "{_escaped(_content(v))}"}}' for v in fmu.variables if v.type in TEXTS
    ] or ['{0, ""}']
    vector = next((i for i, v in enumerate(fmu.variables) if v.name == "y"), 0)
    rows.append(f"  {{FLOAT64, {cells}, 1, -1}},")
    return "\n".join(
        [
            f"#define KIT_VARIABLES {len(rows)}",
            f"#define KIT_CELLS {cells + 1}",
            f"#define KIT_TIME {cells}",
            f"#define KIT_TEXTS {max(texts, 1)}",
            f"#define KIT_VECTOR {vector}",
            f"enum {{ {', '.join(f'{name} = {at}' for name, at in first.items())} }};",
            "static const kit_variable kit_variables[] = {",
            *rows,
            "};",
            f"static const kit_text kit_texts[] = {{{', '.join(text_starts)}}};",
            "static inline void kit_defaults(kit_cell *v) {",
            "  (void)v, (void)kit_texts;",
            *starts,
            "}\n",
        ]
    )


def _places(fmu: Fmu) -> tuple[dict[str, int], int, int]:
    """First cell, or text, of each variable; how many of both there are."""
    first, texts, cells = {}, 0, 0
    for v in fmu.variables:
        if v.type in TEXTS:
            first[v.name], texts = texts, texts + 1
        else:
            first[v.name], cells = cells, cells + v.most
    return first, texts, cells


def _kind(v: Variable, fmi_version: int) -> str:
    """FMI 2's types are those of FMI 3 that hold the same; an enumeration is what carries it."""
    if v.type == "Enumeration":
        return "INT32" if fmi_version == 2 else "INT64"
    return NAMES[3].get(v.type, v.type).upper()


def _starts(v: Variable, first: int) -> Iterator[str]:
    if v.type in TEXTS or v.start is None:
        return
    values = v.start if isinstance(v.start, tuple) else (v.start,)
    member = "real" if v.type in ("Real", "Float32") else "natural" if v.type == "UInt64" else "whole"
    for i, value in enumerate(values):
        yield f"  v[{first + i}].{member} = {_literal(value, v.type)};"


def _literal(value: float | int | bool | str, type_name: str) -> str:
    if type_name in ("Real", "Float32"):
        return repr(float(value))
    return f"{int(value)}u" if type_name == "UInt64" else f"{int(value)}"


def _content(v: Variable) -> bytes:
    """What a string or binary starts with; binaries are written as hexadecimal numbers."""
    text = str(v.start or "")
    return bytes.fromhex(text) if v.type == "Binary" else text.encode()


def _escaped(content: bytes) -> str:
    return "".join(f"\\{byte:03o}" for byte in content)
