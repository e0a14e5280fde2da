"""Foreign FMUs run in processes of their own: what they do there ends in a report, and harms nobody."""

import functools
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack
from orchestrator.core.native import binaries
from orchestrator.fmi.component import runs_here
from orchestrator.fmi.instance import Instance
from orchestrator.run.simulate import simulate
from orchestrator.system.system import System
from records.record import read
from specs.errors import HungError, InputError, RunError
from tests.orchestrator.systems import OSCILLATOR, component, connector, load, ssd

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs Linux")

HERE = Path(__file__).parents[1]
LIMIT_S = 1.0
TRICKS = (
    *(
        "nothing",
        "segfault",
        "abort",
        "exit",
        "hang",
        "overflow",
        "close",
        "print",
        "round",
        "ignore",
        "fork",
    ),
    *("folder", "unknown", "null", "input", "free", "leave", "cut"),
)
DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="villain" guid="villain">
<CoSimulation modelIdentifier="villain" canHandleVariableCommunicationStepSize="true"/>
<ModelVariables>
<ScalarVariable name="value" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="trick" valueReference="2" causality="parameter" variability="fixed">
<Integer start="0"/></ScalarVariable>
<ScalarVariable name="text" valueReference="3" causality="output"><String/></ScalarVariable>
</ModelVariables><ModelStructure><Outputs><Unknown index="1"/><Unknown index="3"/></Outputs></ModelStructure>
</fmiModelDescription>"""


@functools.cache
def library() -> bytes:
    """The villain, compiled."""
    host = compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        thing = Path(scratch) / "villain.o"
        compiler.compile_object(
            HERE / "villain2.c", thing, host.name, [f"-I{SHIM}", "-O0", "-fvisibility=default"]
        )
        # fesetround is libm's; the villain alone may have it.
        return compiler.link_shared(
            [thing], Path(scratch) / "villain.so", host.name, ["-Wl,--no-as-needed", "-lm"]
        ).read_bytes()


def villain(folder: Path, name: str = "villain") -> System:
    """A system of the villain alone."""
    path = folder / "villain.fmu"
    binary = f"binaries/{compiler.host().fmi2_folder}/villain{compiler.host().suffix}"
    path.write_bytes(pack({"modelDescription.xml": DESCRIPTION.encode(), binary: library()}))
    outputs = (connector("value", "output"), connector("text", "output", "String"))
    text = ssd([component(name, "villain", *outputs)])
    return load(folder, text, {"villain": path})


def run(folder: Path, trick: str, ticks: int = 10, **more: object) -> np.ndarray:
    """The villain's output from 0 on."""
    found = simulate(
        villain(folder),
        ticks,
        parameters={"villain.trick": TRICKS.index(trick)},
        record=["villain.value"],
        limit_s=LIMIT_S,
        **more,  # type: ignore[arg-type]
    )
    return found.column("villain.value")


def hosts() -> list[str]:
    """Host processes that this one has started and that still are there, ended ones included."""
    out = subprocess.run(
        ["ps", "-o", "args=", "--ppid", str(os.getpid())], capture_output=True, text=True, check=True
    )
    return [line for line in out.stdout.splitlines() if "slewright-fmu" in line]


@pytest.mark.parametrize(
    ("trick", "words"),
    [
        ("segfault", "its process ended with signal 11 (Segmentation fault) in doStep"),
        ("abort", "its process ended with signal 6 (Aborted) in doStep"),
        ("exit", "its process ended by itself with status 7 in doStep"),
        ("overflow", "its process ended with signal 11 (Segmentation fault) in doStep"),
        ("hang", "no answer from doStep within 1 s; its process was ended"),
        ("leave", "no answer from doStep within 1 s; its process was ended"),
        ("unknown", "the unknown status 77"),
    ],
)
def test_what_ends_its_process_is_reported(tmp_path: Path, trick: str, words: str) -> None:
    path = tmp_path / "r.parquet"
    with pytest.raises(RunError) as caught:
        run(tmp_path, trick, record_path=path)
    assert "component villain failed in the step from t = 0.05 s" in str(caught.value)
    assert words in str(caught.value)
    assert isinstance(caught.value, HungError) == ("no answer" in words)
    record = read(path)
    assert (record.complete, len(record)) == (False, 6)
    assert hosts() == []


@pytest.mark.parametrize("trick", ["nothing", "close", "print", "round", "ignore", "folder", "input", "cut"])
def test_what_does_not_end_it_leaves_us_alone(
    tmp_path: Path, trick: str, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = Path.cwd()
    np.testing.assert_array_equal(run(tmp_path, trick), [0.0, *(k * 0.01 + 0.01 for k in range(10))])
    assert Path.cwd() == folder
    assert 1.0 + 2.0**-53 == 1.0  # rounds to nearest even, as before
    assert "villain" not in capfd.readouterr().out
    assert hosts() == []


def test_what_it_forks_ends_with_it(tmp_path: Path) -> None:
    """Its children are not ours, but of its process group."""
    run(tmp_path, "fork")
    until = time.monotonic() + 20 * LIMIT_S
    while orphans() and time.monotonic() < until:  # told to end already; a busy machine takes its time
        time.sleep(0.05)
    assert orphans() == []


def orphans() -> list[str]:
    """Host processes whose parent has ended, and that still run."""
    out = subprocess.run(["ps", "-eo", "ppid=,stat=,args="], capture_output=True, text=True, check=True)
    found = [line.split() for line in out.stdout.splitlines() if str(binaries().host) in line]
    return [" ".join(line) for line in found if line[0] == "1" and line[1][0] != "Z"]


def test_a_crash_is_seen_where_the_ends_of_children_are_ignored(tmp_path: Path) -> None:
    """Whoever started us may have chosen so; then nobody can ask by which signal it ended."""
    handler = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        with pytest.raises(RunError, match="its process ended in doStep"):
            run(tmp_path, "segfault")
    finally:
        signal.signal(signal.SIGCHLD, handler)


def test_a_null_string_is_an_empty_one(tmp_path: Path) -> None:
    system = villain(tmp_path)
    with Instance(system.components["villain"], isolated=True, limit_s=LIMIT_S) as instance:
        instance.enter_initialisation()
        assert instance.values(["text"]) == {"text": ""}


@pytest.mark.parametrize(
    ("name", "words"), [("hangs", "no answer from instantiate"), ("crashes", "signal 11")]
)
def test_one_that_does_not_come_up_is_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(InputError, match=f"FMU of component {name} .*cannot be instantiated: .*{words}"):
        simulate(villain(tmp_path, name), 1, limit_s=LIMIT_S)
    assert hosts() == []


def test_one_that_hangs_when_it_is_freed_is_ended(tmp_path: Path) -> None:
    began = time.monotonic()
    assert len(run(tmp_path, "free", ticks=2)) == 3
    assert time.monotonic() - began < 30.0  # it would be for ever
    assert hosts() == []


def test_after_its_end_every_call_says_the_same_at_once(tmp_path: Path) -> None:
    system = villain(tmp_path)
    instance = Instance(system.components["villain"], isolated=True, limit_s=LIMIT_S)
    instance.set(trick=TRICKS.index("segfault"))
    instance.enter_initialisation()
    instance.exit_initialisation()
    with pytest.raises(RunError, match="crashed"):
        instance.step(0.05, 0.01)
    for _ in range(1000):
        with pytest.raises(RunError, match="crashed"):
            instance.get("value")
    instance.free()


def test_isolated_and_not_give_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    system = load(tmp_path, OSCILLATOR, ["position", "speed"])
    assert all(runs_here(c, trust=False) for c in system.components.values())
    for algorithm in ("jacobi", "gauss-seidel", "iterate"):
        here = simulate(system, 200, algorithm=algorithm)
        with monkeypatch.context() as patch:
            patch.setattr("orchestrator.run.master.runs_here", lambda component, trust: False)
            apart = simulate(system, 200, algorithm=algorithm)
        assert here.run_hash == apart.run_hash


def test_only_what_was_built_here_or_is_trusted_runs_in_this_process(tmp_path: Path) -> None:
    stranger = villain(tmp_path).components["villain"]
    assert not runs_here(stranger, trust=False)
    assert runs_here(stranger, trust=True)


def test_many_processes_leave_nothing_behind(tmp_path: Path) -> None:
    system = villain(tmp_path)
    files = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(50):
        Instance(system.components["villain"], isolated=True, limit_s=10.0).free()
    assert len(list(Path("/proc/self/fd").iterdir())) == files
    assert hosts() == []
