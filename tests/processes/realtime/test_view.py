"""`gridpeers view` in a real browser: what it shows of a run, and what a click does to the run."""

from __future__ import annotations

import re
import signal
import socket
import urllib.error
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.processes.terminals import Desk, Terminal

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

pytest.importorskip("starlette", reason="the extra view is not installed")
pytest.importorskip("websockets", reason="the extra view is not installed")

WAIT = 40_000
"""Longest wait (ms) for anything on the page."""

SLOW = "0.2"
"""Speed of the runs: a control period is 100 ms of wall time, so that a busy machine keeps pace."""


def run_of(desk: Desk) -> Terminal:
    """A plant, with the agents of inv1, inv2 and inv4 in one terminal."""
    agents = desk.open("agent", "inv1", "inv2", "inv4")
    words = ("--run", "lab", "--listen", desk.options[-1], "--wait", "0", "--speed", SLOW)
    plant = desk.open_bare("plant", "calm.toml", *words)
    plant.expect("t = 0; speed")
    agents.expect("inv4: joins at")
    return plant


def view_of(desk: Desk, *words: str) -> tuple[Terminal, str]:
    """A view of the run, and the address that it printed."""
    view = desk.open("view", "--port", "0", *words)
    return view, view.expect(r"open (http://\S+) in a browser")[1]


def page_of(browser: Browser, url: str) -> Page:
    """The page, with numbers of now on it."""
    page = browser.new_page(viewport={"width": 1500, "height": 1000})
    page.set_default_timeout(WAIT)
    page.goto(url)
    page.wait_for_selector('body[data-live="live"]')
    return page


def status(url: str, **headers: str) -> int:
    """The answer to a request that no browser sends."""
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    try:
        with opener.open(urllib.request.Request(url, headers=headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_a_click_is_a_command_and_stale_numbers_are_not_shown_as_live(desk: Desk, browser: Browser) -> None:
    """A click does to the run what its command does, on every open page; a killed plant leaves no number as of now."""
    plant = run_of(desk)
    _, url = view_of(desk, "--control")
    page, other = page_of(browser, url), page_of(browser, url)
    foreign: list[str] = []
    page.on("request", lambda request: foreign.append(request.url) if not request.url.startswith(url) else None)
    page.reload()
    page.wait_for_selector('[data-link="inv1|inv2"] + .link.used', state="attached")
    assert page.locator("#diagram .inverter:not(.absent)").count() == 3
    assert page.locator("tbody tr").count() == 10
    assert foreign == [], "the page needs nobody but its server"

    page.locator('[data-link="inv1|inv2"]').dispatch_event("click")
    for each in (page, other):
        each.wait_for_selector('[data-link="inv1|inv2"] + .link.cut', state="attached")
    words = page.locator("#command-list code").first.inner_text()
    assert words == "gridpeers link cut inv1 inv2 " + " ".join(desk.options)
    taken = page.wait_for_selector("#event-list :text('link command 1: inv1 <-> inv2: cut')").inner_text()
    told = plant.expect(r"([0-9.]+) s  link command 1: inv1 <-> inv2: cut, from t = ([0-9.]+) s on")
    assert f"from t = {told[2]} s on" in taken
    assert float(told[2]) - float(told[1]) == pytest.approx(0.02), "from the next control period on"

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

    page.evaluate(
        """() => { window.seen = [];
        new MutationObserver(() => seen.push([document.body.dataset.live, gridpeersView.frame.live.since]))
            .observe(document.body, { attributes: true, attributeFilter: ["data-live"] }) }"""
    )
    plant.signal(signal.SIGKILL)
    page.wait_for_selector('body[data-live="gone"]')
    first = page.evaluate("() => seen[0]")
    assert first[0] in ("frozen", "gone")
    assert first[1] <= 1.0, "s after the plant's last word"
    assert page.locator("tbody tr").first.locator("td").all_inner_texts()[1:10] == ["\N{EN DASH}"] * 9
    assert "the plant is gone" in page.locator("#live").inner_text().lower()


def test_a_frozen_plant_and_a_restarted_one_are_told(desk: Desk, browser: Browser) -> None:
    """Numbers of a frozen plant are not of now; those of the plant that comes after it begin anew."""
    plant = run_of(desk)
    view, url = view_of(desk)
    page = page_of(browser, url)

    plant.signal(signal.SIGSTOP)
    page.wait_for_selector('body[data-live="frozen"]')
    assert "silent" in page.locator("#live").inner_text()
    plant.signal(signal.SIGKILL)
    page.wait_for_selector('body[data-live="gone"]')
    words = ("--run", "lab", "--listen", desk.options[-1], "--wait", "0", "--speed", SLOW)
    desk.open_bare("plant", "calm.toml", *words)
    page.wait_for_selector('body[data-live="live"]')
    assert page.evaluate("() => gridpeersView.frame.live.restarts") == 1

    assert page.locator("#control").is_hidden()
    page.evaluate("""() => gridpeersView.socket.send('{"verb":"open","subject":"13-152"}')""")
    page.wait_for_selector("#command-list li.bad :text('only looks')", state="attached")

    view.signal(signal.SIGINT)
    view.end()
    page.wait_for_selector('body[data-live="lost"]')


def test_the_page_is_for_those_who_may_see_it(desk: Desk) -> None:
    """A token is asked for; a page of others reaches it neither by another name nor by another origin."""
    run_of(desk)
    view, url = view_of(desk, "--token", "mine")
    bare = url.partition("?")[0]

    assert status(url) == 200
    assert status(bare) == 401
    assert status(bare + "?token=yours") == 401
    assert status(url, Host="elsewhere.example") == 403
    assert status(url, Origin="http://elsewhere.example") == 403
    assert status(bare + "static/..%2fpage_server.py") == 404
    port = re.findall(r":(\d+)/", bare)[0]
    code, text = desk.type("view", "--port", port)
    assert code == 2
    assert text == f"gridpeers: --port: {port} of 127.0.0.1 is in use; give another one, or 0 for any free one\n"
    view.signal(signal.SIGTERM)
    assert view.end() == 143


def test_an_address_that_cannot_be_is_one_line(desk: Desk, tmp_path: Path) -> None:
    """No traceback; nothing is sought before."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        code, text = desk.type("view", "--port", str(taken.getsockname()[1]))
        assert (code, text.count("\n")) == (2, 1)
    code, text = desk.type("view", "--port", "70000")
    assert (code, text) == (2, "gridpeers: --port: a port is a number from 0 to 65535, got 70000\n")
    code, text = desk.type("view", "--address", "nowhere.invalid", "--port", "0")
    assert code == 2
    assert '--address: "nowhere.invalid" is no address' in text
