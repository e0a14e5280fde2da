"""What the Markdown pages name exists: commands, options, targets, files, links.

The site itself, with anchors and pictures, is checked by `make docs`.
"""

import re
import subprocess
import sys

import pytest

from slewright import reference
from tests.docs import commands

LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]+)")


def test_every_command_on_every_page_exists():
    found = [f"{p}:{said}" for p in commands.pages() for said in commands.problems(p.read_text("utf-8"))]
    assert found == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```sh\nslewright verfy\n```\n", "2: 'slewright' has no command 'verfy'"),
        ("```sh\nls\nslewright verify \\\n  --sead 1\n```\n", "3: 'slewright verify' has no option '--sead'"),
        ("```\n.venv/bin/slewright bench nmpc\n```\n", "2: 'slewright bench' has no command 'nmpc'"),
        ("a\n\n`make docz` makes it", "3: make has no target 'docz'"),
        ("`python -m benchmarks nmpc --fast`", "1: 'python -m benchmarks nmpc' has no option '--fast'"),
        ("`python -m slewright.policy_ablation`", "1: there is no module slewright.policy_ablation"),
        ("in `specs/signal.toml`", "1: there is no specs/signal.toml"),
        ("```sh\nx=$(slewright verify --nothing)\n```\n", "2: 'slewright verify' has no option '--nothing'"),
    ],
)
def test_what_does_not_exist_is_named_with_its_line(text, said):
    assert commands.problems(text) == [said]


@pytest.mark.parametrize(
    "text",
    [
        "`slewright deploy keys add release.pub.pem --keys DIR`",
        "`make verify ARGS=--help`",
        "`slewright bundle … --sign KEY`",
        "```python\nslewright wrong\n```\n",
        "```sh\ninstall -o slewright -g slewright first.slwb /var\n```\n",
        "```sh\nslewright verify --seed -1  # --sead\n```\n",
        "`slewright --version`",
    ],
)
def test_what_exists_or_is_no_command_is_left_alone(text):
    assert commands.problems(text) == []


def test_links_of_all_pages_but_the_readme_lead_to_files():
    # tests/test_house.py has the README's.
    found = [
        f"{page.relative_to(commands.ROOT)}: {link}"
        for page in commands.pages()
        if page != commands.ROOT / "README.md"
        for link in LINK.findall(page.read_text("utf-8"))
        if not (page.parent / link).exists()
    ]
    assert found == []


def test_generated_pages_are_noticed_when_stale_and_written(tmp_path):
    assert reference.write(check=True) == []
    assert {p.name for p in reference.write(folder=tmp_path)} == set(reference.PAGES)
    page = tmp_path / "signals.md"
    page.write_text(page.read_text().replace("q_slew", "q_slow"))
    assert reference.write(check=True, folder=tmp_path) == [page]
    assert reference.write(folder=tmp_path) == [page]
    assert reference.write(check=True, folder=tmp_path) == []
    assert reference.write(folder=tmp_path / "no docs here") == []


def test_the_reference_has_every_definition():
    text = {name: render() for name, render in reference.PAGES.items()}
    assert "### slewright deploy keys add" in text["command-line.md"]
    assert "| `--seed INTEGER` |" in text["command-line.md"]
    assert "| `q_slew` |" in text["signals.md"]
    assert "| `gate_rise` | 10 | 1/s | 1 … 100 |" in text["parameters.md"]
    assert "`coriolis_coupling`" in text["effects.md"]
    assert "| `.rosbag2` |" in text["file-formats.md"]
    assert "[`slewright verify`](command-line.md#slewright-verify)" in text["json-outputs.md"]


def test_the_reference_needs_no_torch():
    code = "import sys; sys.modules['torch'] = None; from slewright import reference; reference.write(True)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=commands.ROOT)
