"""A real browser for tests of the page: Debian's Chromium, without a screen."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from tests.processes.terminals import Desk, Terminal

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
"""A browser that asks nobody outside."""

WAIT = 80_000  # Longest wait (ms) for anything on the page
SLOW = "0.2"  # Speed of the runs: a control period is 100 ms of real time, so that a busy machine keeps pace


@contextmanager
def chromium() -> Iterator[Browser]:
    """Start the browser; the test is skipped where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("chromium is not installed (Debian: apt-get install chromium)")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=QUIET, timeout=WAIT)
        yield browser
        browser.close()


def plant_of(desk: Desk) -> Terminal:
    words = ("--run", "lab", "--listen", desk.options[-1], "--wait", "0", "--speed", SLOW)
    plant = desk.open_bare("plant", "calm.toml", *words)
    plant.expect("t = 0; speed")
    return plant


def run_of(desk: Desk) -> Terminal:
    """A plant, with the agents of inv1, inv2 and inv4 in one terminal."""
    agents = desk.open("agent", "inv1", "inv2", "inv4")
    plant = plant_of(desk)
    agents.expect("inv4: joins at")
    return plant


def view_of(desk: Desk, *words: str) -> tuple[Terminal, str]:
    """A view of the run, and the address that it printed."""
    view = desk.open("view", "--port", "0", *words)
    return view, view.expect(r"open (http://\S+) in a browser")[1]


def page_of(browser: Browser, url: str) -> Page:
    page = browser.new_page(viewport={"width": 1500, "height": 1000})
    page.set_default_timeout(WAIT)
    page.goto(url)
    page.wait_for_selector('body[data-live="live"]')
    return page


def accessible(page: Page) -> dict[str, list[str]]:
    """Names of all that a screen reader finds on a page, by role: Chromium's accessibility tree."""
    session = page.context.new_cdp_session(page)
    nodes: list[dict[str, Any]] = session.send("Accessibility.getFullAXTree")["nodes"]
    session.detach()
    found: dict[str, list[str]] = {}
    for node in nodes:
        if not node.get("ignored"):
            found.setdefault(node["role"]["value"], []).append(node.get("name", {}).get("value", ""))
    return found
