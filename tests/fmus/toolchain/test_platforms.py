"""The same FMU elsewhere: other platforms' binaries, aarch64 bits under qemu, a build with sanitizers."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, build_fmu, compile_library, generate_sources
from fmus.toolchain.loader import load_model
from fmus.toolchain.variables import exposed
from specs.errors import InputError, RunError

OSCILLATOR = Path(__file__).parents[1] / "samples" / "oscillator"
RUNNER = Path(__file__).parent / "fmi2_runner.c"
CROSS_LIBRARIES = Path("/usr/aarch64-linux-gnu")
# Every model that a system is made of; inputs that the runner's pattern (-0.5 .. 0.5) may drive.
DRIVEN = {
    "slew": ["u_slew"],
    "slew_nn": ["u_slew"],
    "arm": ["qd_boom_ref", "qd_stick_ref"],
    "tool": ["radius_rate"],
    "machine": ["u_slew", "u_boom", "u_stick"],
    "pi": ["q_slew", "q_boom"],
    "arm_velocity": ["qd_boom_ref", "qd_stick_ref"],
}
LARGE = ("machine", "slew_nn", "arm_velocity")  # take many seconds to compile
WITH_LONG = [pytest.param(n, marks=pytest.mark.long) if n in LARGE else n for n in DRIVEN]


def runner(folder: Path, target: str) -> Path:
    """The C program that steps an FMI 2 library, for `target`."""
    options = ["-I", str(SHIM / "fmi")]
    built = compiler.compile_object(RUNNER, folder / f"{target}.o", target, extra=options, generated=True)
    return compiler.link_program([built], folder / f"runner-{target}", target, extra=["-ldl"])


def arguments(model_name: str, fmu: Path, steps: int) -> list[str]:
    model = load_model(model_name)
    by_name = {e.name: e for e in exposed(model)}
    inputs = [str(by_name[n].vr) for n in DRIVEN[model_name]]
    outputs = [str(e.vr) for e in by_name.values() if e.group in ("OUTPUT", "STATE")]
    guid = str(fmpy.read_model_description(str(fmu)).guid)
    return [guid, str(steps), str(len(inputs)), *inputs, str(len(outputs)), *outputs]


def unpack(fmu: Path, member: str, folder: Path) -> Path:
    with zipfile.ZipFile(fmu) as archive:
        return Path(archive.extract(member, folder))


@pytest.mark.qemu
@pytest.mark.skipif(shutil.which("qemu-aarch64") is None, reason="qemu-user is not installed")
@pytest.mark.skipif(not CROSS_LIBRARIES.is_dir(), reason="libc6-arm64-cross is not installed")
@pytest.mark.parametrize("name", WITH_LONG)
def test_aarch64_gives_the_same_bits(name: str, tmp_path: Path) -> None:
    host = compiler.host().name
    fmu = build_fmu(name, 2, [host, "aarch64-linux"], out=tmp_path)
    given = arguments(name, fmu, steps=150)
    native_library = unpack(fmu, f"binaries/{compiler.host().fmi2_folder}/{name}.so", tmp_path)
    foreign_library = unpack(fmu, f"binaries/aarch64-linux/{name}.so", tmp_path)
    native = [str(runner(tmp_path, host)), str(native_library), *given]
    foreign = [str(runner(tmp_path, "aarch64-linux")), str(foreign_library), *given]
    here = subprocess.run(native, capture_output=True, text=True, check=True).stdout
    emulated = ["qemu-aarch64", "-L", str(CROSS_LIBRARIES), *foreign]
    there = subprocess.run(emulated, capture_output=True, text=True, check=True).stdout
    assert len(here.splitlines()) == 150
    assert there == here


@pytest.mark.parametrize("name", WITH_LONG)
def test_sanitizers_find_nothing(name: str, tmp_path: Path) -> None:
    """Address and undefined-behaviour sanitizers over shim and generated code, on a driven run."""
    model, host = load_model(name), compiler.host().name
    token = generate_sources(model, tmp_path)
    checks = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"]
    files = ("core.c", "integrator.c", "model.c", "fmi2.c")
    try:
        objects = [
            compiler.compile_object(tmp_path / f, tmp_path / (f + ".o"), host, extra=checks, generated=True)
            for f in files
        ]
        library = compiler.link_shared(objects, tmp_path / "model.so", host, extra=checks)
        main = compiler.compile_object(
            RUNNER, tmp_path / "r.o", host, extra=[*checks, "-I", str(SHIM / "fmi")], generated=True
        )
        program = compiler.link_program([main], tmp_path / "runner", host, extra=[*checks, "-ldl"])
    except RunError as missing:  # a compiler without sanitizer run-time libraries
        pytest.skip(f"no sanitizers here: {str(missing).splitlines()[-1]}")
    fmu = build_fmu(name, 2)
    given = [token, *arguments(name, fmu, steps=60)[1:]]
    done = subprocess.run([str(program), str(library), *given], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize("fmi_version", [2, 3])
def test_cross_builds_have_a_binary_for_each_platform(fmi_version: int, tmp_path: Path) -> None:
    targets = ["x86_64-windows", "aarch64-linux", "aarch64-darwin"]
    fmu = build_fmu(OSCILLATOR, fmi_version, targets, out=tmp_path)
    windows = "win64" if fmi_version == 2 else "x86_64-windows"
    starts = {
        f"binaries/{windows}/oscillator.dll": b"MZ",
        "binaries/aarch64-linux/oscillator.so": b"\x7fELF",
        "binaries/aarch64-darwin/oscillator.dylib": b"\xcf\xfa\xed\xfe",
    }
    with zipfile.ZipFile(fmu) as archive:
        for member, magic in starts.items():
            assert archive.read(member).startswith(magic), member


def test_unknown_target_names_the_valid_ones() -> None:
    with pytest.raises(InputError, match=r"no build target 'sparc-linux'.*x86_64-linux"):
        build_fmu(OSCILLATOR, 2, ["sparc-linux"])


def test_the_compiler_is_known_by_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another ziglang must not be served from the cache of the last one."""
    other = next(name for name in compiler.TARGETS if name != compiler.host().name)
    monkeypatch.setattr(compiler.metadata, "version", lambda package: f"1.2.3 of {package}")
    compiler.identity.cache_clear()
    try:
        assert compiler.identity(other) == "ziglang 1.2.3 of ziglang"
    finally:
        compiler.identity.cache_clear()


def test_without_cc_the_ziglang_package_compiles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine with no compiler builds with zig, and its library computes the same bits."""
    model, host = load_model(OSCILLATOR), compiler.host().name
    token = generate_sources(model, tmp_path)
    by_cc = tmp_path / "cc.so"
    by_cc.write_bytes(compile_library(model, tmp_path, 2, host))
    monkeypatch.setattr(shutil, "which", lambda name: None)
    compiler.command.cache_clear()
    compiler.identity.cache_clear()
    try:
        assert "ziglang" in compiler.command(host)
        by_zig = tmp_path / "zig.so"
        by_zig.write_bytes(compile_library(model, tmp_path, 2, host))
        program = runner(tmp_path, host)
    finally:
        monkeypatch.undo()
        compiler.command.cache_clear()
        compiler.identity.cache_clear()
    outputs = [str(e.vr) for e in exposed(model) if e.group in ("OUTPUT", "STATE")]
    given = [token, "100", "2", "100000", "100001", str(len(outputs)), *outputs]
    printed = [
        subprocess.run([str(program), str(lib), *given], capture_output=True, text=True, check=True).stdout
        for lib in (by_cc, by_zig)
    ]
    assert printed[0] == printed[1]
    assert len(printed[0].splitlines()) == 100
