"""The report opened in a headless browser: everything is drawn, nothing complains, nothing is fetched."""

import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from records.report import write_report
from tests.records.runs import CONTEXT, runs, verdicts

pytestmark = pytest.mark.browser
FIGURES = 2 + 2 * 8


def open_page(browser: str, page: Path, profile: Path, *actions: str) -> subprocess.CompletedProcess[str]:
    """Open a page in the browser, let it draw, and do `actions`."""
    quiet = ("--disable-gpu", "--disable-background-networking", "--no-first-run", "--hide-scrollbars")
    command = [browser, "--headless", "--no-sandbox", *quiet, f"--user-data-dir={profile}"]
    command += ["--enable-logging=stderr", "--virtual-time-budget=60000", "--window-size=1300,2400", *actions]
    # no host is found: whatever the page tried to fetch would fail, and be logged
    command += ["--host-resolver-rules=MAP * ~NOTFOUND", page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)


class Plots(HTMLParser):
    """Counts the lines that each plot has drawn."""

    def __init__(self) -> None:
        super().__init__()
        self.plot = ""
        self.traces: dict[str, int] = {}
        self.drawn = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {k: v or "" for k, v in attrs}
        classes = found.get("class", "").split()
        if tag == "body":
            self.drawn = found.get("data-drawn", "")
        if "plot" in classes and tag == "div" and found.get("id"):
            self.plot = found["id"]
            self.traces[self.plot] = 0
        if tag == "path" and "js-line" in classes and re.search(r"[LCHV]", found.get("d", "")):
            self.traces[self.plot] += 1


@pytest.fixture(scope="module")
def opened(browser, tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    page = write_report(folder / "report.html", runs(), verdicts(), CONTEXT)
    return open_page(browser, page, folder / "profile", "--dump-dom")


@pytest.mark.long
def test_every_plot_draws_its_lines(opened):
    plots = Plots()
    plots.feed(re.sub(r"<script>.*?</script>", "", opened.stdout, flags=re.DOTALL))
    assert plots.drawn == str(FIGURES)
    assert len(plots.traces) == FIGURES
    at_least = {
        "above": 2,
        "side": 2,
        "slew": 3,
        "speeds": 6,
        "joysticks": 4,
        "rate": 4,
        "tool": 4,
        "pressures": 8,
    }
    for name, lines in plots.traces.items():
        kind = name.rsplit("-", 1)[1]
        wanted = 8 if name == "response-arm" else at_least[kind]
        assert lines >= wanted, f"{name}: {lines} lines drawn, expected {wanted}"


def test_the_console_stays_empty(opened):
    assert [line for line in opened.stderr.splitlines() if "CONSOLE" in line] == []


@pytest.mark.long
def test_a_broken_page_would_be_noticed(browser, tmp_path):
    """The two tests above can fail: a figure that plotly refuses shows up in the console."""
    page = write_report(tmp_path / "report.html", runs(), verdicts(), CONTEXT)
    text = page.read_text(encoding="utf-8")
    page.write_text(
        text.replace("id='figures'>[{", 'id=\'figures\'>[{"name":"nowhere"},{', 1), encoding="utf-8"
    )
    broken = open_page(browser, page, tmp_path / "profile", "--dump-dom")
    assert "CONSOLE" in broken.stderr
    assert "data-drawn" not in broken.stdout.split("<script>")[0]


@pytest.mark.long
def test_it_prints(browser, tmp_path):
    page = write_report(tmp_path / "report.html", runs(), verdicts(), CONTEXT)
    printed = tmp_path / "report.pdf"
    open_page(browser, page, tmp_path / "profile", "--no-pdf-header-footer", f"--print-to-pdf={printed}")
    pages = len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes()))
    # results, responses and limits a page or two each, two pages a scenario: plots neither cut off nor alone
    assert 5 <= pages <= 9
