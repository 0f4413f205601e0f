"""`gridpeers view` in a real browser: what it shows of a run, and what a click does to the run."""

from __future__ import annotations

import re
import signal
import urllib.error
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.processes.realtime.browsers import WAIT, accessible, page_of, plant_of, run_of, view_of
from tests.processes.terminals import Desk, Terminal

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip("starlette", reason="the extra view is not installed")
pytest.importorskip("websockets", reason="the extra view is not installed")


def status(url: str, **headers: str) -> int:
    """The answer to a request that no browser sends."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    try:
        with opener.open(urllib.request.Request(url, headers=headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def sets_a_load(desk: Desk, plant: Terminal, page: Page, other: Page) -> None:
    """By factor or in kW and kvar, with the command beside it, on every open page; what makes no sense is refused."""
    page.wait_for_selector('[data-load="48"]', state="attached")
    page.locator('[data-load="48"]').dispatch_event("click")
    assert page.locator("#load-now").inner_text() == "210 kW and 150 kvar at nominal voltage"
    page.locator("#load-factor").fill("1.5")
    page.keyboard.press("Enter")
    assert not page.locator("#load-dialog").is_visible()
    for each in (page, other):
        each.wait_for_selector('[data-load="48"].set', state="attached")
    plant.expect("load 48 set to 315 kW and 225 kvar at nominal voltage, 1.5 times its table")
    page.wait_for_selector("#event-list :text('load 48 set to 315 kW')")
    options = " ".join(desk.options)
    assert page.locator("#command-list code").first.inner_text() == f"gridpeers load 48 --factor 1.5 {options}"
    assert page.locator("#command-list pre").first.text_content() == "[[event]]\nload = { 48 = { factor = 1.5 } }"
    assert "Loads set: 48 (315 kW, 225 kvar)." in other.locator("#diagram-text").inner_text()

    page.get_by_label("load", exact=True).select_option("48")
    page.locator("#load-choice button").click()
    assert page.locator("#load-now").inner_text().startswith("set to 315 kW and 225 kvar; in its table 210 kW")
    page.locator("#load-P").fill("210000")
    page.locator("#load-power-form button").click()
    refused = page.wait_for_selector("#command-list li.bad").inner_text()
    assert f"gridpeers load 48 --P 210000 --Q 225 {options}" in refused
    assert "did you mean 210 (210000 W)?" in refused
    assert desk.type("load", "48", "--factor", "1")[0] == 0
    for each in (page, other):
        each.wait_for_selector('[data-load="48"]:not(.set)', state="attached")


def test_a_click_is_a_command_and_stale_numbers_are_not_shown_as_live(desk: Desk, browser: Browser) -> None:
    """A click does to the run what its command does, on every open page.

    A frozen or killed plant leaves no present number; those of the plant that comes after it begin anew.
    """
    plant = run_of(desk)
    view, url = view_of(desk, "--control")
    page, other = page_of(browser, url), page_of(browser, url)
    foreign: list[str] = []
    page.on("request", lambda request: foreign.append(request.url) if not request.url.startswith(url) else None)
    page.reload()
    page.wait_for_selector('[data-link="inv1|inv2"] + .link.used', state="attached")
    assert page.locator("#diagram .inverter:not(.absent)").count() == 3
    assert page.locator("tbody tr").count() == 10
    assert foreign == [], "the page needs nobody but its server"
    assert page.locator("#run").inner_text() == page.title().removesuffix(" \N{EN DASH} gridpeers view")
    assert page.title().endswith(" \N{MIDDLE DOT} run lab \N{EN DASH} gridpeers view")
    assert page.title().startswith("calm, case ")

    page.locator('[data-link="inv1|inv2"]').dispatch_event("click")
    for each in (page, other):
        each.wait_for_selector('[data-link="inv1|inv2"] + .link.cut', state="attached")
    words = page.locator("#command-list code").first.inner_text()
    assert words == "gridpeers link cut inv1 inv2 " + " ".join(desk.options)
    taken = page.wait_for_selector("#event-list :text('link command 1: inv1 <-> inv2: cut')").inner_text()
    told = plant.expect(r"([0-9.]+) s  link command 1: inv1 <-> inv2: cut, from t = ([0-9.]+) s on")
    assert f"from t = {told[2]} s on" in taken
    periods = (float(told[2]) - float(told[1])) / 0.02
    assert periods == pytest.approx(round(periods)), "with a control period"
    assert round(periods) >= 1, "from the next one on, or from a later one of a plant behind its time"

    page.locator('[data-switch="13-152"]').dispatch_event("click")
    for each in (page, other):
        each.wait_for_selector('[data-switch="13-152"].open', state="attached")
    page.get_by_label("Stop the agent of inv4").click()
    for each in (page, other):
        each.wait_for_selector('[data-agent="inv4"].absent', state="attached")
    plant.expect("inv4 left")
    page.get_by_label("Start the agent of inv4").click()
    plant.expect("inv4 joined")
    for each in (page, other):
        each.wait_for_selector('[data-agent="inv4"]:not(.absent)', state="attached")

    sets_a_load(desk, plant, page, other)

    plant.signal(signal.SIGSTOP)
    page.wait_for_selector('body[data-live="frozen"]')
    assert "silent" in page.locator("#live").inner_text()
    plant.signal(signal.SIGKILL)
    page.wait_for_selector('body[data-live="gone"]')
    assert page.locator("tbody tr").first.locator("td").all_inner_texts()[1:10] == ["\N{EN DASH}"] * 9
    assert "the plant is gone" in page.locator("#live").inner_text().lower()
    plant_of(desk)
    page.wait_for_selector('body[data-live="live"]')
    assert page.evaluate("() => gridpeersView.frame.live.restarts") == 1

    view.signal(signal.SIGSTOP)
    page.wait_for_selector('body[data-live="lost"]')
    assert "these numbers are old" in page.locator("#live").inner_text()
    view.signal(signal.SIGCONT)
    page.wait_for_selector('body[data-live="live"]')
    view.signal(signal.SIGINT)
    view.end()
    page.wait_for_selector('body[data-live="lost"]')


def test_the_diagram_by_keyboard_and_for_a_screen_reader(desk: Desk, browser: Browser) -> None:
    """Everything that can be clicked has a role, a name with its state, a place in the order of focus and a key."""
    run_of(desk)
    _, url = view_of(desk, "--control")
    page = page_of(browser, url)
    for pair in ("inv1|inv2", "inv1|inv4", "inv2|inv4"):
        page.wait_for_selector(f'[data-link="{pair}"] + .link.used', state="attached")
    found = accessible(page)

    names = set(found["button"])
    assert {f"link {pair}, heard" for pair in ("inv1 to inv2", "inv1 to inv4", "inv2 to inv4")} <= names
    assert {"switch 13-152, closed", "inverter inv1, GFM", "inverter inv3, GFL, no agent"} <= names
    assert "load 48, 210 kW and 150 kvar at nominal voltage" in names
    assert "Stop the agent of inv1" in names
    assert all(found["button"]), "a button without a name says nothing"
    groups = {"Links", "Switches", "Loads", "Inverters", "One-line diagram of the feeder with its communication links"}
    assert groups <= set(found["group"])
    assert {"Feeder and links", "Last 30 s", "Agents", "Events", "Commands"} <= set(found["region"])
    text = page.locator("#diagram-text").inner_text()
    assert re.match(r"10 inverters, without an agent: inv3, .* and 1 more\. .*3 links, all heard\.$", text)
    assert "switches, " in text

    focused = "() => document.activeElement.getAttribute('aria-label')"
    page.locator("input[name=tool]:checked").focus()
    page.keyboard.press("Tab")
    assert page.evaluate(focused) == "link inv1 to inv2, heard"
    page.keyboard.press("End")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(focused) == "link inv1 to inv2, heard", "after the last one comes the first"
    assert "inv1 \N{RIGHTWARDS ARROW} inv2: used" in page.locator("#tip").inner_text()
    page.keyboard.press("Enter")
    page.wait_for_selector('[aria-label="link inv1 to inv2, cut"]', state="attached")
    assert page.evaluate(focused) == "link inv1 to inv2, cut", "the focus stays"
    assert "1 cut (inv1\N{EN DASH}inv2)" in page.locator("#diagram-text").inner_text()

    for kind in ("switch ", "load ", "inverter "):
        page.keyboard.press("Tab")
        assert page.evaluate(focused).startswith(kind), "one stop of the tab key for each kind"
        assert page.evaluate("() => getComputedStyle(document.activeElement).outlineStyle") == "solid"
        if kind == "switch ":
            page.locator('[data-switch="13-152"]').focus()
            page.keyboard.press("Space")
            page.wait_for_selector('[aria-label="switch 13-152, open"]', state="attached")
        if kind == "load ":
            page.locator('[data-load="48"]').focus()
            page.keyboard.press("Enter")
            assert accessible(page)["dialog"] == ["Load 48"]
            page.keyboard.press("Escape")
            assert page.evaluate(focused).startswith("load 48"), "the focus comes back from the dialog"
    page.set_viewport_size({"width": 1200, "height": 800})
    page.wait_for_function("() => document.querySelector('#diagram').getAttribute('viewBox').split(' ')[2] < 800")
    assert page.evaluate(focused).startswith("inverter "), "a diagram that is drawn anew keeps the focus"


def test_views_are_for_those_who_may_see_them_and_only_look(desk: Desk, browser: Browser) -> None:
    """Each has its own port and its own rights: a token is asked for, and a page of others reaches none.

    Without --control the diagram is of images, and Enter does nothing; what ended is told, and no number stays.
    """
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    plant = run_of(desk)
    _, url = view_of(desk, "--control")
    token = "mine & yours: \N{GREEK SMALL LETTER PI}/?#;%"
    view, closed = view_of(desk, "--token", token)
    bare = closed.partition("?")[0]

    assert status(closed) == 200, "any letter of a token is quoted in the address"
    assert status(bare) == 401
    assert status(bare + "?token=yours") == 401
    assert status(closed, Host="elsewhere.example") == 403
    assert status(closed, Origin="http://elsewhere.example") == 403
    assert status(bare + "static/..%2fpage_server.py") == 404
    port = re.findall(r":(\d+)/", bare)[0]
    in_use = f"gridpeers: --port: {port} of 127.0.0.1 is in use; give another one, or 0 for any free one\n"
    assert desk.type("view", "--port", port) == (2, in_use)

    page = page_of(browser, url)
    with pytest.raises(InvalidStatus):
        connect(bare.replace("http", "ws") + "frames", open_timeout=WAIT / 1e3)
    looking = browser.new_page()
    looking.set_default_timeout(WAIT)
    looking.goto(bare)
    looking.get_by_label("Token").fill("yours")
    looking.keyboard.press("Enter")
    looking.get_by_role("alert").filter(has_text="That is not the token of this view.").wait_for()
    looking.get_by_label("Token").fill(token)
    looking.keyboard.press("Enter")
    looking.wait_for_selector('body[data-live="live"]')
    assert looking.url == bare, "the token does not stay in the address"

    page.locator('[data-switch="13-152"]').dispatch_event("click")
    plant.expect("switch 13-152 opened")
    looking.wait_for_selector('[data-switch="13-152"].open', state="attached")
    assert looking.locator("#control").is_hidden()

    looking.wait_for_selector('[data-link="inv1|inv2"] + .link.used', state="attached")
    found = accessible(looking)
    assert "link inv1 to inv2, heard" in found["image"]
    assert not [name for name in found.get("button", []) if name.startswith(("link", "switch", "load", "inverter"))]
    looking.locator('[data-load="48"]').focus()
    looking.keyboard.press("Enter")
    assert not looking.locator("#load-dialog").is_visible()
    looking.evaluate("""() => gridpeersView.socket.send('{"kind":"open","subject":"60-160"}')""")
    looking.wait_for_selector("#command-list li.bad :text('read-only')", state="attached")

    assert desk.type("down")[0] == 0
    looking.wait_for_selector('body[data-live="ended"]')
    assert "The run has ended" in looking.locator("#live").inner_text()
    assert looking.locator("#diagram-text").inner_text().startswith("Last known state")
    assert looking.locator("tbody tr").first.locator("td").all_inner_texts()[:9] == ["\N{EN DASH}"] * 9
    view.signal(signal.SIGTERM)
    assert view.end() == 143


def test_an_address_that_cannot_be_is_one_line(desk: Desk, tmp_path: Path) -> None:
    """No traceback; nothing is sought before."""
    code, text = desk.type("view", "--address", "nowhere.invalid", "--port", "0")
    assert code == 2
    assert '--address: "nowhere.invalid" is not an address' in text
