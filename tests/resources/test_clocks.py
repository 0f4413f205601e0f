"""No host's clock of the day decides anything: it may jump, stand still, or be far off."""

from __future__ import annotations

import ast
import time
from itertools import pairwise
from pathlib import Path

import pytest

from gridpeers.wire.driver.process import new_epoch
from gridpeers.wire.messages import MOST_COUNT
from tests.toy.town import Town

ROOT = Path(__file__).parents[2]

DAY_CLOCKS = {
    "time": {"time", "time_ns", "localtime", "gmtime", "ctime", "asctime", "strftime", "clock_gettime"},
    "datetime.datetime": {"now", "utcnow", "today"},
    "datetime.date": {"today"},
}
"""Clocks of the day by the module or class that has them."""

ALLOWED = {
    "wire/driver/process.py": "tells two processes of one name apart, with random bits",
    "wire/trust/key_folder.py": "ends of certificates are dates",
    "wire/trust/site_authority.py": "the same",
    "scenarios/run.py": "the record says when a run began",
    "scenarios/live/live_files.py": "names of folders, and the same",
    "viewer/record_pages.py": "how long ago a file was written, which only says whether to look again",
}
"""Files that may ask for the time of the day, and what for."""

BROKEN = """
import random
import time

YEARS = random.Random()


def jumping():
    "Any time from 1970 to 2100."
    return YEARS.uniform(0.0, 4.1e9)


time.time = jumping
time.time_ns = lambda: int(1e9 * jumping())
"""


def asked_for(source: str) -> set[str]:
    """Return the clocks of the day that a program calls or passes on, by what its names were imported as."""
    tree = ast.parse(source)
    meant: dict[str, str] = {}
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                meant |= {alias.asname or alias.name: alias.name for alias in names}
            case ast.ImportFrom(module=str(module), names=names):
                meant |= {alias.asname or alias.name: f"{module}.{alias.name}" for alias in names}

    def meaning(node: ast.AST) -> str:
        match node:
            case ast.Name(id=name):
                return meant.get(name, "")
            case ast.Attribute(value=value, attr=attr):
                return f"{meaning(value)}.{attr}"
        return ""

    clocks = {f"{where}.{clock}" for where, clocks in DAY_CLOCKS.items() for clock in clocks}
    return clocks & {meaning(node) for node in ast.walk(tree)}


@pytest.mark.parametrize(
    ("source", "clock"),
    [
        ("from time import time as clock\nclock()", "time.time"),
        ("import time\ndef f(clock=time.time): pass", "time.time"),
        ("from datetime import datetime as D\nD.now()", "datetime.datetime.now"),
        ("import time\nfrom time import monotonic\ntime.monotonic(); monotonic()", ""),
        ("from gridpeers.wire.timing import time_of\nself.time(); self.now(); now = 1; now", ""),
    ],
)
def test_a_clock_of_the_day_is_found_under_any_name(source: str, clock: str) -> None:
    """However it was imported, called at once or passed on; a clock that never jumps is none, nor is another `now`."""
    assert asked_for(source) == ({clock} if clock else set())


def test_the_processes_of_a_run_ask_only_a_clock_that_never_jumps() -> None:
    """Deadlines, ages, ticks and leases count on `monotonic`; who asks for the time of the day is listed here."""
    rooms = ("wire", "agents", "plant", "netem", "scenarios", "viewer")
    files = [path for room in rooms for path in (ROOT / room).rglob("*.py")]
    asking = {str(path.relative_to(ROOT)) for path in files if asked_for(path.read_text())}

    assert asking == set(ALLOWED)


def test_a_run_does_not_notice_clocks_that_jump(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By decades, whenever they are asked: no step is lost, and an agent that comes back is believed and used."""
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "sitecustomize.py").write_text(BROKEN)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "broken"))
    two = ("inv1", "inv2")
    with Town(2, tmp_path).all() as town:
        first = town.status["inv2"].epoch
        town.until(lambda: town.t >= 0.6, "rows")
        town.children["inv2"].signal(9)
        town.until_event("inv2", "inv2 died").start("inv2")
        town.until(lambda: town.status["inv2"].epoch != first, "the new process").together(two)
        steps = [b[0] - a[0] for a, b in pairwise(town.rows)]

        assert max(steps) == pytest.approx(0.02)


def test_an_epoch_is_new_though_the_clock_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    """And it fits into its field, whatever the clock says."""
    for clock in (0, 10**18, -(10**18), 2**63 - 1):
        monkeypatch.setattr(time, "time_ns", lambda clock=clock: clock)
        epochs = {new_epoch() for _ in range(64)}

        assert len(epochs) > 32
        assert all(0 <= epoch <= MOST_COUNT for epoch in epochs)
