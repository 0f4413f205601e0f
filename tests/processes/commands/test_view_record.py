"""`gridpeers view RECORD` in a real browser: a record at any time, by slider and by key."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gridpeers.lab.explanation.explanation import explain
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.processes.terminals import Desk, wait_for
from tests.record.recorded_runs import recorded_run

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip("starlette", reason="the extra view is not installed")
pytest.importorskip("websockets", reason="the extra view is not installed")

WAIT = 80_000  # Longest wait (ms) for anything on the page

ISLANDED = """
name = "islanded"
[time]
end_s = {end}
[[event]]
label = "event1"
t_s = 0.2
open = ["13-152"]
[[event]]
label = "event2"
t_s = 0.6
load = {{ 48 = {{ factor = 1.5 }} }}
[case.one]
secondary = "all"
graph = "full"
[[case.one.link]]
on = "inv1 <-> inv2"
cut = true
from_s = 0.5
"""


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with Desk(tmp_path) as terminals:
        yield terminals


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("records")
    second = '[case.two]\nsecondary = "all"\ngraph = "full"\n'
    (folder / "it.toml").write_text(ISLANDED.format(end=1.0) + second, encoding="utf-8")
    for case in ("one", "two"):
        recorded_run(folder / "it.toml", case, folder / "run" / case)
    return folder


def page_of(browser: Browser, url: str) -> Page:
    page = browser.new_page(viewport={"width": 1500, "height": 1200})
    page.set_default_timeout(WAIT)
    page.goto(url)
    page.wait_for_selector('body[data-live="record"]')
    return page


def shows(page: Page, t: float) -> None:
    """Wait until the page shows a time (s)."""
    page.wait_for_function("t => Math.abs(gridpeersView.frame?.t - t) < 1e-6 && !gridpeersPlayer.busy", arg=t)
    page.wait_for_function("t => document.getElementById('time').textContent === `t = ${t.toFixed(2)} s`", arg=t)


def power(page: Page) -> str:
    """What the table says of inv1's real power (kW)."""
    return page.locator("tbody tr").first.locator("td").nth(3).inner_text()


def test_a_record_is_seen_at_any_time(desk: Desk, browser: Browser, records: Path) -> None:
    """Slider, keys and events choose the time; values, links, switches and a decision are those of the record then."""
    record = RunRecord.open(records / "run" / "one")
    history = record.physics()

    def expected(t: float) -> str:
        return f"{history.P[[k for k, at in enumerate(history.t) if at <= t + 1e-9][-1], 0] / 1e3:.1f}"

    view = desk.open_bare("view", str(records / "run"), "--case", "one", "--port", "0")
    url = view.expect(r"record \S*run/one: open (http://\S+) in a browser; Ctrl-C ends the page")[1]
    page = page_of(browser, url)
    errors: list[Any] = []
    page.on("pageerror", lambda error: errors.append(error))
    shows(page, 1.0)
    assert page.locator("#run").inner_text() == "islanded, case one"
    assert power(page) == expected(1.0)
    page.wait_for_selector('[data-link="inv1|inv2"] + .link.cut', state="attached")
    page.wait_for_selector('[data-switch="13-152"].open', state="attached")
    page.wait_for_selector('[data-load="48"].set', state="attached")
    assert "Loads set: 48 (315 kW, 225 kvar)." in page.locator("#diagram-text").inner_text()

    page.locator("#slider").evaluate("slider => { slider.value = 0.3; slider.dispatchEvent(new Event('input')) }")
    shows(page, 0.3)
    assert power(page) == expected(0.3) != expected(1.0)
    page.wait_for_selector('[data-link="inv1|inv2"] + .link.used', state="attached")
    page.wait_for_selector('[data-load="48"]:not(.set)', state="attached")

    page.locator("#slider").focus()
    for key, t in (("ArrowRight", 0.32), ("ArrowLeft", 0.3), ("ArrowLeft", 0.28), ("Home", 0.0), ("End", 1.0)):
        page.keyboard.press(key)
        shows(page, t)
        assert power(page) == expected(t)
    page.locator("#event-list .jump", has_text="switch 13-152 opened").click()
    shows(page, 0.2)
    page.keyboard.press("ArrowLeft")
    shows(page, 0.18)
    page.wait_for_selector('[data-switch="13-152"].closed', state="attached")
    page.locator("h1").click()
    page.keyboard.press(" ")
    page.wait_for_function("() => gridpeersView.frame.t > 0.25")
    assert page.locator("#play").inner_text() in ("Play", "Pause")
    shows(page, 1.0)

    page.get_by_label("Show how inv2 decided").click()
    page.locator("#decision-text", has_text="inv2 at t = 0.98 s").wait_for()
    assert page.locator("#decision-text").inner_text().strip() == str(explain(record, "inv2", 1.0)).strip()
    assert page.locator("#decision-command").inner_text() == f"gridpeers why {records}/run/one inv2 1"
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    page.locator("#decision-text", has_text="inv2 at t = 0.96 s").wait_for()

    other = page_of(browser, url)
    shows(other, 1.0)
    shows(page, 0.96)
    assert page.evaluate("""() => { gridpeersView.socket.send('{"kind":"open","subject":"13-152"}'); return 1 }""")
    page.keyboard.press("Home")
    shows(page, 0.0)
    assert errors == []
    view.signal(signal.SIGINT)
    assert view.end() == 130
    page.wait_for_selector('body[data-live="lost"]')


UNREACHED = """() => {
    const diagram = document.querySelector("#diagram"), found = [];
    const means = (x, y, kind, subject) => {
        const over = document.elementFromPoint(x, y);
        if (!diagram.contains(over)) return false;
        over.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y, bubbles: true }));
        return gridpeersView.tip?.kind === kind && gridpeersView.tip?.subject === subject;
    };
    for (const target of diagram.querySelectorAll("[data-kind]")) {
        const points = [], { kind, subject } = target.dataset, box = target.getBoundingClientRect();
        if (kind === "link") for (let at = 0; at < target.getTotalLength(); at += 2) {
            const { x, y } = target.getPointAtLength(at).matrixTransform(target.getScreenCTM());
            points.push([x, y]);
        }
        else for (let x = box.left; x < box.right; x += 2)
            for (let y = box.top; y < box.bottom; y += 2) points.push([x, y]);
        if (!points.some(([x, y]) => means(x, y, kind, subject))) found.push(`${kind} ${subject}`);
    }
    return [diagram.querySelectorAll("[data-kind]").length, found];
}"""
"""Return the number of targets of the diagram, and those that the pointer reaches nowhere."""


def test_every_target_of_the_diagram_can_be_reached(desk: Desk, browser: Browser, records: Path) -> None:
    """At 1400 px the pointer reaches each of them, however they overlap; a phone shows the page without its edges."""
    view = desk.open_bare("view", str(records / "run"), "--case", "one", "--port", "0")
    page = page_of(browser, view.expect(r"open (http://\S+) in a browser")[1])
    page.set_viewport_size({"width": 1400, "height": 1200})
    shows(page, 1.0)
    page.wait_for_selector('[data-link="inv1|inv2"] + .link.cut', state="attached")

    targets, unreached = page.evaluate(UNREACHED)

    assert targets > 100
    assert unreached == []
    assert page.locator("#diagram .branch.dead").count() == 0
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_function("() => document.querySelector('#diagram').getAttribute('viewBox') === '0 0 620 430'")
    assert page.evaluate("() => document.documentElement.scrollWidth") == 390
    assert page.evaluate("() => document.querySelector('.pan').scrollWidth") == 620


def test_a_run_that_has_ended_is_offered_as_a_record(desk: Desk, browser: Browser) -> None:
    """Its page, opened at its begin, follows it, and has its slider after its end."""
    few = 'graph = "full"\nwithout_agent = ["inv3", "inv5", "inv6", "inv7", "inv8", "inv9"]\n'
    text = ISLANDED.format(end=2.0).replace('graph = "full"\n', few)
    (desk.folder / "it.toml").write_text(text, encoding="utf-8")
    run = desk.open_bare("run", "it.toml", "--clock", "realtime", "--out", "out")
    wait_for(desk.folder / "out" / "status.txt", "running")
    view = desk.open_bare("view", "out", "--port", "0")
    url = view.expect(r"open (http://\S+) in a browser; Ctrl-C ends the page")[1]
    page = browser.new_page(viewport={"width": 1500, "height": 1200})
    page.set_default_timeout(WAIT)
    page.goto(url)
    assert run.end() == 0
    page.wait_for_selector('body[data-live="record"]')
    shows(page, 2.0)
    assert page.locator("#run").inner_text() == "islanded, case one"

    page.locator("#slider").focus()
    page.keyboard.press("Home")
    shows(page, 0.0)
    page.get_by_label("Show how inv4 decided").click()
    page.locator("#decision-text", has_text="inv4").wait_for()
    view.signal(signal.SIGINT)
    assert view.end() == 130
    page.wait_for_selector('body[data-live="lost"]')
    assert RunRecord.open(desk.folder / "out" / "one").complete


def test_bad_input_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is no record, or does not go with one, is told before anything is served or run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.mcap").write_bytes(b"nothing of the kind")
    for words, complaint in (
        (("view", "run.mcap"), "run.mcap: this is not a record: it does not begin as an MCAP file; give a run.mcap"),
        (("view", "gone"), "gone: cannot be read: No such file or directory"),
        (("view", "run.mcap", "--control"), "--control: needs a live run; a record cannot be changed"),
        (("view", "--case", "IV"), "--case: goes with a RECORD; a live run has one case"),
        (("view", "--port", "70000"), "--port: a port is a number from 0 to 65535, got 70000"),
    ):
        assert invoke(*words) == (2, f"gridpeers: {complaint}\n")
    assert not (tmp_path / "runs").exists()


def test_a_click_leaves_the_keys_with_the_time_and_the_address_keeps_it(
    desk: Desk, browser: Browser, records: Path
) -> None:
    """One key does one thing; the decision goes with the time and is seen; case and time outlive a reload."""
    view = desk.open_bare("view", str(records / "run"), "--port", "0")
    page = page_of(browser, view.expect(r"open (http://\S+) in a browser")[1])
    page.set_viewport_size({"width": 1400, "height": 900})
    shows(page, 1.0)

    page.locator("#goto").fill("0.44")
    page.keyboard.press("Enter")
    shows(page, 0.44)
    page.locator("#goto").fill("")
    page.keyboard.press("Enter")
    page.locator("#goto").fill("7")
    page.keyboard.press("Enter")
    assert page.locator("#goto-note").inner_text() == "the record ends at 1.00 s"
    shows(page, 0.44)
    page.locator('[data-agent="inv4"] .body').click()
    page.locator("#decision-text", has_text="inv4 at t = 0.44 s").wait_for()
    seen = page.locator("#decision-text").bounding_box()
    assert seen is not None
    assert seen["y"] + 200 < 900, "the explanation is on the screen"
    page.keyboard.press("ArrowRight")
    page.locator("#decision-text", has_text="inv4 at t = 0.46 s").wait_for()
    shows(page, 0.46)
    assert page.evaluate("() => document.activeElement === document.body"), "the focus has not moved"
    page.locator('[data-agent="inv4"]').focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("() => document.activeElement.dataset.agent") == "inv5"
    page.keyboard.press("ArrowLeft")
    page.keyboard.press(" ")
    page.locator("#decision-hint").wait_for()
    assert page.locator("#play").inner_text() == "Play"
    shows(page, 0.46)

    page.get_by_label("case", exact=True).select_option("one")
    page.wait_for_function("() => document.getElementById('run').textContent === 'islanded, case one'")
    shows(page, 0.46)
    page.wait_for_url("**/#case=one&t=0.46")
    page.reload()
    page.wait_for_function("() => document.getElementById('run').textContent === 'islanded, case one'")
    shows(page, 0.46)
    assert page.locator(".key .microgrid").first.inner_text() == "MG1"
    page.evaluate("() => { gridpeersView.frame = null; gridpeersView.socket.close(); }")
    shows(page, 0.46)
    assert page.locator("#run").inner_text() == "islanded, case one"
