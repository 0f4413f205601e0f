"""Memory of the view over time: of its server and of Chromium's tab, with a real run, an open page and events.

    .venv/bin/python -m bench.view_memory --minutes 60
    .venv/bin/python -m bench.view_memory --minutes 20 --json memory.json

Looks every `--every` seconds: resident anonymous memory of the server's process and of the tab's (Linux), and the
JavaScript heap after a collection of garbage. Growth per hour is the slope of a straight line through the looks after
the warm-up, with its standard error. A load is set twice a second, so that the page's 200 events are full after 100 s.
"""

from __future__ import annotations

import json
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from bench.harness import load, machine, options, say
from bench.long_runs import size
from bench.viewed_run import ViewedRun

LOAD = "48"


class Look(NamedTuple):
    """One look at the view."""

    at: float
    """Time since the page showed numbers (s)."""
    server: float
    """Anonymous memory (MB) of the view's server."""
    tab: float
    """The same of the tab's process."""
    heap: float
    """JavaScript heap in use (MB), after a collection."""
    elements: float
    """Nodes of the page's document, attached or not."""


def renderer_of(run: ViewedRun) -> int:
    """Return the process that draws the only page: of all renderers the one that has used most processor time."""
    session = run.browser.new_browser_cdp_session()
    processes: list[dict[str, Any]] = session.send("SystemInfo.getProcessInfo")["processInfo"]
    session.detach()
    renderers = [one for one in processes if one["type"] == "renderer"]
    return int(max(renderers, key=lambda one: one["cpuTime"])["id"])


def slope(looks: list[Look], name: str) -> tuple[float, float]:
    """Return the growth per hour of a column, and its standard error.

    Examples
    --------
    >>> rise = [Look(at=60.0 * k, server=50.0 + k, tab=0.0, heap=0.0, elements=0.0) for k in range(10)]
    >>> [round(x, 6) for x in slope(rise, "server")]
    [60.0, 0.0]
    """
    t = np.array([one.at for one in looks]) / 3600.0
    y = np.array([getattr(one, name) for one in looks])
    rate, first = np.polyfit(t, y, 1)
    rest = y - (rate * t + first)
    error = np.sqrt(np.sum(rest**2) / (len(t) - 2) / np.sum((t - t.mean()) ** 2))
    return float(rate), float(error)


def main() -> None:
    """Run, look, print, and write what is asked for."""
    given = options(__doc__, minutes=60.0, agents=9, every=10.0, warm=0.25, json="")
    print(machine())
    looks: list[Look] = []
    with ViewedRun(given.agents) as run:
        view = run.open_view()
        session = view.page.context.new_cdp_session(view.page)
        tab, began, k = renderer_of(run), monotonic(), 0
        while (at := monotonic() - began) < 60.0 * given.minutes:
            session.send("HeapProfiler.collectGarbage")
            heap, dom = session.send("Runtime.getHeapUsage"), session.send("Memory.getDOMCounters")
            server_mb, tab_mb = size(view.server.pid), size(tab)
            looks.append(Look(at, server_mb, tab_mb, heap["usedSize"] / 1e6, float(dom["nodes"])))
            if len(looks) % 6 == 1:
                say(
                    f"{at / 60.0:.1f} min: server {server_mb:.1f} MB, tab {tab_mb:.1f} MB, heap {looks[-1].heap:.2f} MB"
                )
            due = began + at + given.every
            while monotonic() < due:
                run.set_load(LOAD, 1.0 + 0.01 * (k % 11))
                k += 1
                run.client.until(lambda: False, 0.5)
        live = view.page.evaluate("() => document.body.dataset.live")
    warm = [one for one in looks if one.at >= given.warm * looks[-1].at]
    print(f"{looks[-1].at / 60.0:.1f} min, {given.agents} agents, {k} events, page at its end: {live}; load {load()}")
    print(f"{'':10}{'warm':>10}{'last':>10}   growth per hour")
    growth = {}
    for name, unit in (("server", "MB"), ("tab", "MB"), ("heap", "MB"), ("elements", "")):
        rate, error = slope(warm, name)
        first, last = getattr(warm[0], name), getattr(warm[-1], name)
        growth[name] = {"warm": first, "last": last, "per_hour": rate, "error": error}
        print(f"{name:10}{first:10.2f}{last:10.2f}   {rate:+.2f} +- {error:.2f} {unit}")
    if given.json:
        found = {"machine": machine(), "minutes": looks[-1].at / 60.0, "events": k, "growth": growth}
        Path(given.json).write_text(json.dumps(found | {"looks": [one._asdict() for one in looks]}, indent=1) + "\n")


if __name__ == "__main__":
    main()
