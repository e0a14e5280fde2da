"""The house itself: commands, locks and papers say the same, and nothing ties it to one machine."""

import ast
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT

README = (ROOT / "README.md").read_text()
LOCKS = sorted((ROOT / "requirements").glob("*.lock"))


def tracked_files() -> list[Path]:
    """The text files under version control."""
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    paths = (ROOT / name for name in listed.split("\0") if name)
    return [path for path in paths if path.is_file() and b"\0" not in path.read_bytes()[:4096]]


def requirements(lock: Path) -> dict[str, str]:
    """Requirement line -> the hash lines below it."""
    blocks = re.split(r"\n(?=[a-z0-9])", lock.read_text())
    return {block.split(" ", 1)[0]: block for block in blocks if not block.startswith("#")}


def test_readme_names_the_two_commands_and_the_makefile_has_them():
    makefile = (ROOT / "Makefile").read_text()
    for command in ("verify", "test"):
        assert re.search(rf"^make {command}\b", README, re.MULTILINE)
        assert re.search(rf"^{command}:", makefile, re.MULTILINE)


def test_folders_in_the_readme_exist():
    named = set(re.findall(r"`([a-z]+)/`", README))
    assert {name for name in named if not (ROOT / name).is_dir()} == set()


def test_links_in_the_readme_lead_somewhere():
    links = [link for link in re.findall(r"\]\(([^)#]+)", README) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_continuous_integration_runs_the_readmes_test_command_then_check():
    lines = [line.strip() for line in (ROOT / ".ci" / "run").read_text().splitlines()]
    assert lines.index("make test") < lines.index("make check")
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111


@pytest.mark.parametrize("script", [".ci/run", "requirements/install", "requirements/make-venv"])
def test_scripts_parse(script):
    shell = "bash" if script == ".ci/run" else "sh"
    subprocess.run([shell, "-n", ROOT / script], check=True)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_a_lock_pins_and_hashes_everything_and_names_no_host(lock):
    text = lock.read_text()
    assert "://" not in text
    assert "--index" not in text
    assert "--find-links" not in text
    found = requirements(lock)
    assert len(found) > 30
    assert [name for name, block in found.items() if "==" not in name or "--hash=sha256:" not in block] == []


def test_the_test_lock_holds_the_verify_lock():
    verify, test = (set(requirements(ROOT / "requirements" / f"{name}.lock")) for name in ("verify", "test"))
    assert verify - test == set()
    assert not any(name.startswith(("torch==", "onnxruntime", "nvidia-")) for name in verify)


def test_locks_hold_what_the_project_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    asked = {
        "verify": [*project["dependencies"], *extras["verify"], *extras["build"]],
        "test": [*project["dependencies"], *(name for extra in extras.values() for name in extra)],
    }
    for lock, wanted in asked.items():
        locked = {name.split("==")[0] for name in requirements(ROOT / "requirements" / f"{lock}.lock")}
        assert {re.split(r"[\[<>=;]", name)[0] for name in wanted} - locked == set()


def test_the_runtime_install_is_light():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = " ".join(project["dependencies"] + project["optional-dependencies"]["runtime"])
    assert not re.search(r"\b(torch|casadi|fmpy)\b", wanted)


def test_nothing_tracked_names_a_path_of_a_machine_or_a_package_registry():
    homes = "|".join(("work", "root", "home", "Users"))
    hosts = "|".join(("py" + r"pi\.org", "python" + "hosted", r"deb\." + "debian"))
    path = re.compile(rf"(?<![\w.}}>-])/(?:{homes})/\w|{hosts}")
    found = [
        f"{file.relative_to(ROOT)}: {match.group()}"
        for file in tracked_files()
        if (match := path.search(file.read_text(errors="replace")))
    ]
    assert found == []


def test_no_module_shadows_the_standard_library():
    names = {"can.py", "types.py", "signal.py"}
    assert [str(path) for path in tracked_files() if path.name in names] == []


def test_every_test_folder_is_a_package():
    folders = {path.parent for path in (ROOT / "tests").rglob("test_*.py")}
    assert [str(folder) for folder in folders if not (folder / "__init__.py").is_file()] == []


ROOMS = (
    *("specs", "records", "fmus", "orchestrator", "runtime", "baselines", "learning"),
    *("verification", "deployment", "benchmarks", "slewright"),
)


def imports() -> dict[str, set[str]]:
    """Module -> the modules of the rooms that it imports anywhere, for types too."""
    paths = [p for room in ROOMS for p in (ROOT / room).rglob("*.py")]
    known = {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}
    graph = {}
    for name, path in known.items():
        found = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= names | ({node.module or ""} if names - known.keys() else set())
        graph[name] = found & known.keys() - {name}
    return graph


def test_no_import_circle():
    left = imports()
    assert len(left) > 500
    while ready := {name for name, needs in left.items() if not needs & left.keys()}:
        left = {name: needs for name, needs in left.items() if name not in ready}
    while unused := left.keys() - {need for needs in left.values() for need in needs}:
        left = {name: needs for name, needs in left.items() if name not in unused}
    assert left == {}, "these modules import each other"
