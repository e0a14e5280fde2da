"""The page in a real browser: what it shows, how it fits, what it refuses, and that it asks nobody else."""

import json
import shutil
from collections.abc import Iterator

import pytest

from runtime.hmi import desk as desks, watch
from runtime.hmi.alarms import Condition, Level
from runtime.modbus.port import PERIOD_NS
from runtime.shared import private_folder
from tests.runtime.bench import STANDBY
from tests.runtime.bundles import core
from tests.runtime.hmi.browser import Browser
from tests.runtime.hmi.served import Served, until, value

pytestmark = pytest.mark.browser
SIZES = {"desktop": (1440, 900), "tablet": (1024, 768), "upright": (768, 1024)}
PAGES = ("machine", "trends", "alarms", "statistics", "signals")
LONG = 10**12
WHOLE = "document.documentElement"
MODE = "document.querySelector('#mode').textContent"
BADGE = "document.querySelector('#forced')"
NAV = "[...document.querySelectorAll('main > section:not([hidden]) > *, footer, header, nav')]"
TOUCHED = "[...document.querySelectorAll('button, select, nav a')]"
EVIL = "<img src=x onerror=\"document.title='hurt'\">"


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    """One for all tests; rights do not lapse here, since a test's computer may be slow."""
    folder, patch = private_folder("slewright-test-"), pytest.MonkeyPatch()
    patch.setattr(desks, "LAPSE_NS", LONG)
    patch.setattr("runtime.hmi.port.timeout_ticks", lambda signal: LONG // PERIOD_NS)
    patch.setattr("runtime.hmi.watch.STALE_NS", LONG)
    with Served(core("pd"), folder) as found:
        yield found
    patch.undo()
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="module")
def page(served: Served, browser: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(browser, tmp_path_factory.mktemp("browser")) as found:
        found.open(served.address)
        yield found


def text(page: Browser, selector: str) -> str:
    return page.run(f"document.querySelector({json.dumps(selector)})?.textContent ?? ''")


def sign_in(page: Browser, served: Served, role: str, name: str = "Ada") -> None:
    page.click("#sign")
    page.write("#name", name)
    page.write("#token", served.tokens[role])
    page.click("#sign-in")
    page.wait(f"document.querySelector('#who').textContent.includes({json.dumps(role)})")


def sign_out(page: Browser) -> None:
    page.click("#sign")
    page.wait("document.querySelector('#who').textContent === 'read only'")


def test_it_shows_the_state_and_the_machine_moves(page: Browser):
    page.wait("document.querySelector('#mode').textContent === 'standby'")
    drawn = "document.querySelector('#above g[transform^=rotate]').getAttribute('transform')"
    first = page.run(drawn)
    page.wait(f"{drawn} !== {json.dumps(first)}")
    assert page.run("[...document.querySelectorAll('#side line')].every(x => isFinite(x.getAttribute('x1')))")
    shown = text(page, "#values")
    assert "°" in shown
    assert "NaN" not in shown
    footer = text(page, "footer")
    assert "No emergency stop here" in footer
    assert "not a safety function" in footer
    assert text(page, "#source") == "simulated machine"


@pytest.mark.parametrize("size", SIZES)
def test_every_page_fits_and_can_be_touched(page: Browser, size: str):
    page.resize(*SIZES[size])
    for name in PAGES:
        page.run(f"location.hash = '#{name}'")
        page.wait(f"!document.querySelector('#{name}').hidden")
        assert page.run(f"{WHOLE}.scrollHeight <= innerHeight && {WHOLE}.scrollWidth <= innerWidth"), name
        small = page.run(
            f"{TOUCHED}.filter(x => x.offsetParent !== null)"
            ".filter(x => x.getBoundingClientRect().height < 43.5 || x.getBoundingClientRect().width < 40)"
            ".map(x => x.outerHTML)"
        )
        assert small == [], name
        outside = page.run(
            NAV + ".filter(x => {"
            "const r = x.getBoundingClientRect();"
            "return r.right > innerWidth + 1 || r.bottom > innerHeight + 1; }).map(x => x.id || x.className)"
        )
        assert outside == [], name
    page.run("location.hash = '#machine'")


def test_it_reads_only_until_somebody_signs_in(page: Browser, served: Served):
    assert text(page, "#take") == ""
    page.click("#sign")
    page.write("#name", "Eve")
    page.write("#token", "guess")
    page.click("#sign-in")
    page.wait("!document.querySelector('#toast').hidden")
    assert "not known" in text(page, "#toast")
    page.run("document.querySelector('#dialog').close()")
    assert text(page, "#who") == "read only"
    refused = "fetch('api/hold', {method: 'POST', body: '{}', headers: {'Content-Type': 'application/json'}})"
    assert page.run(f"{refused}.then(x => x.status)") == 401
    page.complaints.clear()  # the browser itself tells of refused requests


def test_an_operator_sets_a_target_by_hand_and_by_touch_and_holds(page: Browser, served: Served):
    sign_in(page, served, "operator")
    page.click("#take")
    page.wait("document.querySelector('#go') !== null")
    for name, number in (("target_x", "6.5"), ("target_y", "7"), ("target_z", "5")):
        page.write(f"#{name}", number)
    assert page.run("document.querySelector('#above .draft').getAttribute('visibility')") == "visible"
    assert value(served, "target_valid") == 0.0  # nothing before Go
    page.click("#go")
    until(lambda: value(served, "target_x") == 6.5 and value(served, "target_valid") == 1.0)
    page.wait("document.querySelector('#above .target').getAttribute('visibility') === 'visible'")
    styles = "['#above', '#side'].map(x => getComputedStyle(document.querySelector(`${x} .target circle`)))"
    assert page.run(f"{styles}.every(x => x.fill === 'none' && x.vectorEffect === 'non-scaling-stroke')")
    page.run(
        "(() => { const r = document.querySelector('#above').getBoundingClientRect();"
        "document.querySelector('#above').dispatchEvent(new MouseEvent('click', {bubbles: true,"
        "clientX: r.left + r.width / 2, clientY: r.top + r.height / 4})); })()"
    )
    assert abs(float(page.run("document.querySelector('#target_x').value"))) < 0.2
    assert float(page.run("document.querySelector('#target_y').value")) > 5.0
    page.click("#hold")
    until(lambda: value(served, "target_valid") == 0.0)
    page.click("#release")
    page.wait("document.querySelector('#take') !== null")
    until(lambda: served.desk.writer is None)
    page.run("location.hash = '#signals'")
    assert not page.run(
        "[...document.querySelectorAll('#signal-list button')].length"
    )  # an operator does not force
    sign_out(page)


def test_service_forces_in_standby_and_every_page_says_so(page: Browser, served: Served):
    sign_in(page, served, "service", "Grace")
    page.run("location.hash = '#signals'")
    until(lambda: served.mode == STANDBY)
    row = "[...document.querySelectorAll('#signal-list tr')].find(x => x.textContent.startsWith('p_pump'))"
    page.wait(f"!{row}.querySelector('button').disabled")
    page.run(f"{row}.querySelector('button').click()")
    page.write("#force-value", "150")
    page.click("#force-go")
    until(lambda: abs(value(served, "p_pump") - 1.5e7) < 1.0)
    for name in PAGES:
        page.run(f"location.hash = '#{name}'")
        page.wait(f"!{BADGE}.hidden && {BADGE}.offsetParent !== null")
    page.run("location.hash = '#alarms'")
    page.click("#audit-load")
    page.wait("document.querySelector('#audit-list').textContent.includes('→ 150.0 bar')")
    served.bench.set(operator_enable=1.0)
    page.wait(f"{MODE} === 'armed' && {BADGE}.hidden")
    page.wait("document.querySelector('#toast').textContent === 'Forcing has ended'")
    page.run("location.hash = '#signals'")
    page.wait(f"{row}.querySelector('button').disabled")
    served.bench.set(operator_enable=0.0)
    page.wait("document.querySelector('#mode').textContent === 'standby'")
    assert page.run("document.querySelector('#forced').hidden")
    sign_out(page)
    page.run("location.hash = '#machine'")


TAP = (
    "(c => [0.46, 0.8].forEach(x => c.dispatchEvent(new PointerEvent('pointerdown', "
    "{clientX: c.getBoundingClientRect().left + 8 + x * (c.clientWidth - 150), "
    "clientY: c.getBoundingClientRect().top + 20, bubbles: true}))))(document.querySelector('#plot'))"
)


@pytest.mark.long
def test_the_scope_holds_reads_with_two_cursors_and_waits_for_a_trigger(page: Browser, served: Served):
    state = "document.querySelector('#scope-state').textContent"
    read = "[...document.querySelectorAll('#scope-read span')]"
    shown = f"JSON.stringify({read}.map(x => x.textContent))"
    page.run("location.hash = '#trends'")
    served.bench.set(p_pump=1e7)
    until(lambda: abs(value(served, "p_pump") - 1e7) < 1.0)
    page.run(
        "[...document.querySelectorAll('#trend-bar button')].find(x => x.textContent === '30 s').click()"
    )
    choose = "(s => (s.value = 'p_pump', s.dispatchEvent(new Event('change'))))"
    page.run(f"{choose}(document.querySelector('#scope-signal'))")
    page.write("#scope-level", "150")
    page.click("#scope-arm")
    page.wait(f"{state} === 'waits until p_pump rises above 150'")
    for _ in range(3):  # it is below for a while, to begin with
        clock = page.run("document.querySelector('#clock').textContent")
        page.wait(f"document.querySelector('#clock').textContent !== {json.dumps(clock)}")
    served.bench.set(p_pump=2e7)
    page.wait(f"/^triggered at \\d\\d:\\d\\d:\\d\\d[.,]\\d{{3}}/.test({state})")
    page.wait(f"{state}.endsWith(', held')")  # half of the span later
    page.run(TAP)
    found = json.loads(page.run(shown))
    assert "B − A 10.200 s" in found[0]  # 0.34 of 30 s
    assert "p_pump 100.0 → 200.0 (100.0) bar" in found
    served.bench.set(p_pump=2.1e7)
    until(lambda: abs(value(served, "p_pump") - 2.1e7) < 1.0)
    assert json.loads(page.run(shown)) == found  # what is held stays
    page.click("#scope-clear")
    page.wait(f"{shown} === '[]'")
    page.click("#scope-hold")
    page.wait(f"!{state}.includes('held')")
    page.run("location.hash = '#machine'")


def test_times_of_the_audit_log_have_milliseconds(page: Browser, served: Served):
    sign_in(page, served, "operator")
    page.run("location.hash = '#alarms'")
    page.run("document.querySelector('#audit-list tbody').replaceChildren()")  # of tests before
    page.click("#audit-load")
    page.wait(
        "/\\d:\\d\\d[.,]\\d{3}$/.test(document.querySelector('#audit-list td.time')?.textContent ?? '')"
    )
    sign_out(page)
    page.run("location.hash = '#machine'")


def test_texts_from_outside_stay_texts(page: Browser, served: Served, monkeypatch: pytest.MonkeyPatch):
    sign_in(page, served, "operator", EVIL)
    extra = [Condition("evil", Level.CRITICAL, EVIL, EVIL)]
    found = watch.conditions
    monkeypatch.setattr(watch, "conditions", lambda *seen: [*found(*seen), *extra])
    page.wait("document.querySelector('#banner').className.includes('critical')")
    assert text(page, "#banner-text").startswith(EVIL)
    page.run("location.hash = '#alarms'")
    page.wait("document.querySelector('#alarm-list').textContent.includes('onerror')")
    page.click("#audit-load")
    page.wait("document.querySelector('#audit-list').textContent.includes('onerror')")
    page.click("#acknowledge-all")
    page.wait("document.querySelector('#alarm-list').textContent.includes('seen by')")
    monkeypatch.undo()
    page.wait("!document.querySelector('#banner').className.includes('critical')")
    assert page.run("document.querySelectorAll('img').length") == 0
    assert page.run("document.title") == "Slewright"
    sign_out(page)
    page.run("location.hash = '#machine'")


def test_it_says_so_when_nothing_new_comes(page: Browser, served: Served):
    served.hold_still.set()
    page.wait("document.body.classList.contains('stale')")
    assert text(page, "#mode") == "unknown"
    assert "not up to date" in text(page, "#banner-text")
    served.hold_still.clear()
    page.wait(f"!document.body.classList.contains('stale') && {MODE} === 'standby'")


def test_it_is_reached_with_the_keyboard(page: Browser):
    page.run("document.activeElement.blur()")
    reached = set()
    for _ in range(14):
        page.press("Tab")
        reached.add(page.run("(x => x.id || x.hash || '')(document.activeElement)"))
    assert {"#machine", "#trends", "#alarms", "#statistics", "#signals", "sign"} <= reached
    page.run("document.querySelector('nav a[href=\"#trends\"]').focus()")
    page.press("Enter")
    page.wait("!document.querySelector('#trends').hidden")
    page.run("location.hash = '#machine'")


def test_nothing_was_asked_of_anybody_else_and_the_console_is_empty(page: Browser, served: Served):
    """The last one: over all that the tests above did."""
    assert page.requests
    assert [r for r in page.requests if not r.startswith((served.address, "about:", "data:"))] == []
    # a beat that crosses the end of its right is refused, and the browser says so
    assert [c for c in page.complaints if not ("409" in c and "api/beat" in c)] == []


def test_a_request_to_elsewhere_would_be_refused_and_noticed(page: Browser):
    found = page.run("fetch('http://192.0.2.1/').then(() => 'had', () => 'refused')")
    assert found == "refused"
    assert any("Content Security Policy" in c or "violates" in c for c in page.complaints)
