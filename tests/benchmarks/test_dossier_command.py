"""`python -m benchmarks dossier`: table, exit code, files; the dossier itself: tests/verification/dossier."""

import json
from pathlib import Path
from typing import Any

import pytest

import verification.dossier
from tests.benchmarks.command import benchmarks


@pytest.fixture
def dossier(monkeypatch: pytest.MonkeyPatch):
    """Put a stand-in behind the command that finds one figure of `found` against a limit of 1 °/s."""

    def arrange(found: float, judged: bool = True) -> None:
        check = {"found": found, "limit": 1.0, "unit": "°/s", "at_least": False}
        check |= {"passed": found <= 1.0, "judged": judged}

        def run(out: Path, *_: Any, **__: Any) -> dict[str, Any]:
            out.write_text("# page\n")
            return {"accepted": check["passed"] or not judged, "checks": {"speed": check}}

        monkeypatch.setattr(verification.dossier, "run", run)

    return arrange


@pytest.mark.parametrize(
    ("found", "judged", "code", "said"),
    [(0.5, True, 0, "met"), (2.0, True, 1, "missed"), (2.0, False, 0, "not judged")],
)
def test_a_missed_limit_is_exit_code_1(dossier, tmp_path, capsys, found, judged, code, said) -> None:
    dossier(found, judged)
    out, figures = tmp_path / "page.md", tmp_path / "figures.json"
    assert benchmarks("dossier", "--out", out, "--json", figures) == code
    assert out.read_text() == "# page\n"
    assert said in capsys.readouterr().out
    assert json.loads(figures.read_text())["checks"]["speed"]["found"] == found


@pytest.mark.parametrize("option", ["--out", "--html", "--json"])
def test_a_file_that_cannot_be_written_is_said_before_anything_runs(
    dossier, tmp_path, capsys, option
) -> None:
    dossier(0.5)
    wrong = tmp_path / "missing" / "file"
    assert benchmarks("dossier", "--out", tmp_path / "page.md", option, wrong) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
