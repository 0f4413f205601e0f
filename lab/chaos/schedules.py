"""Schedules of disturbances: hypothesis draws them by a seed, and shrinks one that fails.

A schedule is drawn as a list of disturbances, each with its beginning and its end, not step by step beside a running
system: a run takes place between its first and its last tick, so a stateful test would have nothing to look at in
between. As each disturbance brings its end along, hypothesis can leave out any of them and the rest stays possible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from math import ceil
from typing import Any

import hypothesis
import msgspec
from hypothesis import HealthCheck, Phase
from hypothesis import strategies as st

from gridpeers.lab.chaos.disturbed_scenario import ChaosBase, Disturbance, Schedule
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.schema.participants import with_agent

BATCH = 25
"""Schedules that are drawn together, from one seed. So the first runs of a seed do not depend on the number of runs,
and shrinking one draws few of them again."""

TRIES = 150  # Most runs to shrink a schedule. A fifth is reserved for leaving out single disturbances after hypothesis.

MOST_DISTURBANCES = 10

BEGIN_S, AFTER_S, LONGEST_S = 0.2, 0.5, 2.0
"""Times (s): the earliest beginning, the latest one after the scenario's own last change, the longest disturbance."""

MOST_LOADS = 20  # Most loads that a step changes: a quarter of those of the standard feeder

_FAR = 7_203_117_000_000_061
"""A number that no program is likely to contain. hypothesis prefers integers from the source code of loaded modules, so
any change of a module would change the schedules. It finds none near this number."""


class _FailsError(Exception):
    """A schedule fails."""


def drawn(base: ChaosBase, seed: int, batch: int) -> list[Schedule]:
    """Return the schedules of a batch (from 0); a seed gives the same ones with the same version of hypothesis."""
    found: list[Schedule] = []
    _search(base, seed, batch, found.append, (Phase.generate,))
    return found + [()] * (BATCH - len(found))  # there are fewer where hardly anything is possible


def shrunk(base: ChaosBase, seed: int, number: int, fails: Callable[[Schedule], bool]) -> Schedule:
    """Return the simplest schedule found that fails, begun with that of a run: few disturbances, short and early.

    `fails` is asked once for each schedule, and `TRIES` times at most. A run beyond those that hypothesis draws had no
    disturbances, and its schedule stays empty.
    """
    batch, place = divmod(number, BATCH)
    known: dict[bytes, bool] = {}
    simplest: Schedule = ()
    passed = 0

    def known_to_fail(schedule: Schedule, most: int) -> bool:
        key = msgspec.json.encode(schedule)
        if key not in known and len(known) < most:
            known[key] = fails(schedule)
        return known.get(key, False)

    def attempt(schedule: Schedule) -> None:
        nonlocal passed, simplest
        if passed <= place:
            passed += 1
            if passed <= place:
                return
            known[msgspec.json.encode(schedule)] = True
        if known_to_fail(schedule, TRIES - TRIES // 5):
            simplest = schedule
            raise _FailsError

    with suppress(_FailsError):  # of the simplest one, which hypothesis tries again at the end
        _search(base, seed, batch, attempt, (Phase.generate, Phase.shrink))
    return _without_idle_ones(base, simplest, lambda schedule: known_to_fail(schedule, TRIES))


def _without_idle_ones(base: ChaosBase, schedule: Schedule, fails: Callable[[Schedule], bool]) -> Schedule:
    """Return a failing schedule without the disturbances that it fails without.

    hypothesis leaves out few numbers in a row, which a disturbance of many is not.
    """
    for disturbance in schedule:
        rest = tuple(it for it in schedule if it is not disturbance)
        if base.is_possible(rest) and fails(rest):
            return _without_idle_ones(base, rest, fails)
    return schedule


def _search(
    base: ChaosBase, seed: int, batch: int, attempt: Callable[[Schedule], None], phases: tuple[Phase, ...]
) -> None:
    """Let hypothesis draw the schedules of a batch, from a seed of its own."""
    given = hypothesis.given(schedules(base))(lambda schedule: attempt(schedule))
    settings = hypothesis.settings(
        max_examples=BATCH,
        phases=phases,
        database=None,
        deadline=None,
        derandomize=False,
        report_multiple_bugs=False,
        print_blob=False,
        suppress_health_check=list(HealthCheck),
        verbosity=hypothesis.Verbosity.quiet,
    )
    hypothesis.seed(seed * 1_000_003 + batch)(settings(given))()


# -------------------------------------------------------------------- what may happen, and when


def schedules(base: ChaosBase) -> st.SearchStrategy[Schedule]:
    return st.lists(_disturbances(base), max_size=MOST_DISTURBANCES).map(base.kept)


@st.composite
def _disturbances(draw: st.DrawFn, base: ChaosBase) -> Disturbance:
    return _Draw(base, lambda bound: draw(st.integers(_FAR, _FAR + bound - 1)) - _FAR).disturbance()


class _Draw:
    def __init__(self, base: ChaosBase, pick: Callable[[int], int]) -> None:
        scenario, feeder = base.scenario, base.feeder
        self._base, self._pick = base, pick
        self._rows = {row.name: row for row in with_agent(scenario, feeder, base.case)}
        self._names = list(self._rows)
        self._microgrids = list(dict.fromkeys(row.microgrid for row in self._rows.values() if row.microgrid))
        self._spares = [row.name for row in feeder.spares if row.name not in self._rows]
        self._switches = [switch.alias or switch.name for switch in feeder.switches if len(switch.phases) == 3]
        self._loads = list(named_loads(feeder))
        time = scenario.time
        self._step = time.T_c_s * ceil(1.5 * time.record_s / time.T_c_s - 1e-9)
        """Distance (s) between possible times of events, so that a row is recorded between two of them."""

    def disturbance(self) -> Disturbance:
        kinds = [self._cut, self._partition, self._delay, self._loss, self._noise, self._pause]
        kinds += [self._slow, self._lie, self._kill, self._leave]
        kinds += [self._join] * bool(self._spares) + [self._load] * bool(self._loads)
        kinds += [self._switch] * bool(self._switches)
        make: Callable[[], Disturbance] = self._one_of(kinds)
        return make()

    # ---------------------------------------------------------------- numbers

    def _one_of(self, these: Sequence[Any]) -> Any:
        return these[self._pick(len(these))]

    def _begin(self) -> float:
        first = ceil(BEGIN_S / self._step - 1e-9)
        last = int((self._base.settled_s + AFTER_S) / self._step)
        return self._time(first + self._pick(max(1, last - first + 1)))

    def _end(self, begin: float) -> float:
        return self._time(round(begin / self._step) + 1 + self._pick(round(LONGEST_S / self._step)))

    def _time(self, steps: int) -> float:
        return round(steps * self._step, 9)

    def _span(self) -> dict[str, float]:
        begin = self._begin()
        return {"from_s": begin, "to_s": self._end(begin)}

    # ---------------------------------------------------------------- links

    def _on(self) -> str:
        name = self._one_of(self._names)
        other = self._one_of([it for it in self._names if it != name] or [name])
        patterns = [f"{name} <-> {other}", f"{name} -> {other}", f"{name} -> *", f"* -> {name}", f"plant -> {name}"]
        patterns += [f"{name} -> plant", f"plant <-> {name}", "* <-> *"]
        if len(self._microgrids) > 1:
            group = self._one_of(self._microgrids)
            patterns += [f"{group} <-> {self._one_of([it for it in self._microgrids if it != group])}"]
        return str(self._one_of(patterns))

    def _link(self, **fault: Any) -> Disturbance:
        return Disturbance(table="link", entry={"on": self._on(), **self._span(), **fault})

    def _cut(self) -> Disturbance:
        return self._link(cut={"hold": True} if self._pick(3) == 2 else True)

    def _delay(self) -> Disturbance:
        low = 0.02 * (1 + self._pick(10))
        high = low + 0.02 * self._pick(15)
        if high == low:
            return self._link(delay=round(low, 3))
        return self._link(delay={"model": "uniform", "low_s": round(low, 3), "high_s": round(high, 3)})

    def _loss(self) -> Disturbance:
        return self._link(loss=round(0.05 * (1 + self._pick(19)), 2))

    def _noise(self) -> Disturbance:
        return self._link(**self._one_of([{"duplicate": 0.3}, {"corrupt": 0.1}, {"duplicate": 0.3, "corrupt": 0.1}]))

    def _partition(self) -> Disturbance:
        name = self._one_of(self._names)
        how: list[dict[str, Any]] = [{"alone": name}, {"by": "halves"}, {"by": "island"}]
        how += [{"by": "microgrid"}, {"groups": [[self._one_of(self._microgrids)]]}] if self._microgrids else []
        entry = {**self._one_of(how), **self._span()}
        return Disturbance(table="partition", entry=entry | ({"hold": True} if self._pick(3) == 2 else {}))

    # ---------------------------------------------------------------- agents

    def _node(self, **fault: Any) -> Disturbance:
        return Disturbance(table="node", entry={"name": self._one_of(self._names), **self._span(), **fault})

    def _pause(self) -> Disturbance:
        return self._node(pause=True)

    def _slow(self) -> Disturbance:
        return self._node(slow_s=round(0.01 * (1 + self._pick(20)), 3))

    def _kill(self) -> Disturbance:
        entry = {"name": self._one_of(self._names), "from_s": self._begin(), "kill": True}
        return Disturbance(table="node", entry=entry)

    def _lie(self) -> Disturbance:
        name = self._one_of(self._names)
        W = round(self._rows[name].P_rated * 0.05 * (1 + self._pick(20)), 3)
        lies: list[dict[str, Any]] = [
            {"model": "offset", "P_set_W": W, "Q_var": W},
            {"model": "offset", "P_set_W": -W, "V_set_V": 100.0},
            {"model": "scale", "P_set": 0.5, "Q": -1.0},
            {"model": "freeze"},
            {"model": "replay", "delay_s": 1.0},
            {"model": "random", "P_set_W": W, "Q_var": W},
            {"model": "random", "P_set_W": W, "V_set_V": 50.0, "two_faced": True},
            {"model": "extreme", "side": "high"},
            {"model": "extreme", "side": "alternate"},
        ]
        lie = self._one_of(lies)
        others = [it for it in self._names if it != name]
        reach = self._pick(4)
        if reach == 2:
            lie |= {"plant": True}
        elif reach == 3 and others and self._base.scenario.security == "none":
            lie |= {"in_name_of": self._one_of(others)}
        return Disturbance(table="node", entry={"name": name, **self._span(), "lies": lie})

    # ---------------------------------------------------------------- events

    def _event(self, there: dict[str, Any], back: dict[str, Any]) -> Disturbance:
        begin = self._begin()
        end = {"t_s": self._end(begin), **back} if self._pick(3) else {}
        return Disturbance(table="event", entry={"t_s": begin, **there}, back=end)

    def _leave(self) -> Disturbance:
        name = self._one_of(self._names)
        return self._event({"leave": [name]}, {"join": [name]})

    def _join(self) -> Disturbance:
        name = self._one_of(self._spares)
        return self._event({"join": [name]}, {"leave": [name]})

    def _load(self) -> Disturbance:
        first = self._pick(len(self._loads))
        names = self._loads[first : first + 1 + self._pick(MOST_LOADS)]
        factor = self._one_of([0.0, 0.5, 1.5, 2.0])
        there = {name: {"factor": factor} for name in names}
        return self._event({"load": there}, {"load": {name: {"factor": 1.0} for name in names}})

    def _switch(self) -> Disturbance:
        switch = self._one_of(self._switches)
        opens, closes = {"open": [switch]}, {"close": [switch], "synchronised": True}
        return self._event(opens, closes) if self._pick(3) else self._event(closes, opens)
