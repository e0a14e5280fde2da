"""Log categories: FMUs are told those that are asked for, here and in processes of their own."""

import json
import tempfile
from pathlib import Path

import pytest

from fmus.toolchain import compiler
from fmus.toolchain.build import SHIM, pack
from orchestrator.fmi.log_text import named
from orchestrator.run.simulate import simulate
from orchestrator.system.check import load_system
from specs.errors import InputError
from tests.conftest import Command
from tests.orchestrator.every import every

SOURCE = Path(__file__).parents[1] / "talker.c"
STEPS, VALUES = (tuple(f"{name} at {t:g} s" for t in (0.0, 0.1)) for name in ("steps", "values"))


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI2", "FMI3"])
def talker(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    version, host = request.param, compiler.host()
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch) / "talker.o"
        flags = (f"-I{SHIM}", f"-DFMI={version}", "-fvisibility=default")
        compiler.compile_object(SOURCE, made, host.name, flags)
        linked = compiler.link_shared([made], Path(scratch) / f"talker{host.suffix}", host.name).read_bytes()
    categories = "".join(
        f'<Category name="{n}" description="All {n}"/>' for n in ("steps", "values", "broken")
    )
    token = "guid" if version == 2 else "instantiationToken"
    text = (
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="talker" {token}="t">'
        f'<CoSimulation modelIdentifier="talker"/><LogCategories>{categories}</LogCategories>'
        '<DefaultExperiment stopTime="0.2" stepSize="0.1"/><ModelVariables/><ModelStructure/>'
        "</fmiModelDescription>"
    )
    path = tmp_path_factory.mktemp("talker") / "talker.fmu"
    folder = host.fmi2_folder if version == 2 else host.name
    path.write_bytes(
        pack({"modelDescription.xml": text.encode(), f"binaries/{folder}/talker{host.suffix}": linked})
    )
    return path


@pytest.mark.parametrize("trust", [False, True], ids=["apart", "here"])
@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ((), []),
        (("steps",), [*STEPS]),
        (("values", "steps"), [STEPS[0], VALUES[0], STEPS[1], VALUES[1]]),
        (("all",), [STEPS[0], VALUES[0], STEPS[1], VALUES[1]]),
    ],
)
def test_an_fmu_logs_what_it_is_told(
    talker: Path, asked: tuple[str, ...], said: list[str], trust: bool
) -> None:
    record = simulate(load_system(talker), 2, log_categories=asked, trust=trust)
    assert record.meta.get("messages", {}).get("talker", []) == said


@pytest.mark.parametrize("trust", [False, True], ids=["apart", "here"])
def test_a_refusal_is_said(talker: Path, trust: bool) -> None:
    with pytest.raises(InputError, match="it refuses the log categories"):
        simulate(load_system(talker), 2, log_categories=["broken"], trust=trust)


def test_the_commands_know_it(talker: Path, slewright_here: Command, tmp_path: Path) -> None:
    figures, out = tmp_path / "c.json", tmp_path / "r.parquet"
    assert slewright_here("check", talker, "--log", "steps", "--json", figures).returncode == 0
    (component,) = json.loads(figures.read_text())["components"]
    assert component["log_categories"] == {n: f"All {n}" for n in ("steps", "values", "broken")}
    done = slewright_here("simulate", talker, "--log", "values", "--out", out)
    assert done.returncode == 0, done.stderr
    assert f"talker says: {VALUES[1]}" in done.stdout
    assert "steps at" not in done.stdout


@pytest.mark.parametrize("command", ["check", "simulate"])
def test_an_unknown_category_is_named_with_the_choices(
    talker: Path, slewright_here: Command, tmp_path: Path, command: str
) -> None:
    out = tmp_path / "r.parquet"
    done = slewright_here(command, talker, "--log", "stps", *(["--out", out] * (command == "simulate")))
    assert done.returncode == 2
    assert "'stps'; valid: broken, steps, values, all" in done.stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("version", "text", "shown"),
    [
        (2, "#r1# of #i61# is 3 ## 4", "Real.in of Integer.in is 3 # 4"),
        (2, "#b1# and #r999# and # alone", "#b1# and #r999# and # alone"),
        (3, "#r1# ##", "#r1# ##"),
    ],
)
def test_messages_show_the_names_that_they_refer_to(
    tmp_path: Path, version: int, text: str, shown: str
) -> None:
    assert named(text, every(version, tmp_path).component.model) == shown
