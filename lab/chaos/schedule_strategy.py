"""Schedules of disturbances as a strategy of hypothesis: what may happen, and when.

A schedule is drawn as a list of disturbances, each with its beginning and its end, not step by step beside a running
system: a run takes place between its first and its last tick, so a stateful test would have nothing to look at in
between. As each disturbance brings its end along, hypothesis can leave out any of them and the rest stays possible.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

from hypothesis import strategies as st

from gridpeers.lab.chaos.disturbance import Disturbance, Schedule
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.schema.participants import with_agent

MOST_DISTURBANCES = 10
"""Most disturbances of a schedule, of which some may not be possible together."""

LONGEST_S = 2.0
"""Longest disturbance that ends (s)."""

AFTER_S = 0.5
"""Time (s) after the scenario's last change up to which disturbances begin."""

MOST_LOADS = 20
"""Most loads that a step changes: a quarter of those of the standard feeder."""

BEGIN_S = 0.2
"""Earliest run time (s) of a disturbance."""

_FAR = 7_203_117_000_000_061
"""A number that no program is likely to contain. hypothesis prefers integers that it finds in the source code of
loaded modules, so a seed would draw other schedules after any change of any of them; near this one it finds none."""

Pick = Callable[[int], int]
"""Draws a whole number from 0 to below a bound; towards 0 is simpler."""

Make = Callable[["_Draw"], Disturbance]


def schedules(base: ChaosBase) -> st.SearchStrategy[Schedule]:
    """Return the strategy of the schedules that are possible in a scenario.

    Parameters
    ----------
    base : ChaosBase
        The scenario.
    """
    return st.lists(_disturbances(base), max_size=MOST_DISTURBANCES).map(base.kept)


@st.composite
def _disturbances(draw: st.DrawFn, base: ChaosBase) -> Disturbance:
    return _Draw(base, lambda bound: draw(st.integers(_FAR, _FAR + bound - 1)) - _FAR).disturbance()


class _Draw:
    """Draw one disturbance of a scenario.

    Parameters
    ----------
    base : ChaosBase
        The scenario.
    pick : Pick
        Draws numbers.
    """

    def __init__(self, base: ChaosBase, pick: Pick) -> None:
        scenario, feeder = base.scenario, base.feeder
        self._base, self._pick = base, pick
        rows = [row for row in with_agent(scenario, feeder, base.case)]
        self._rows = {row.name: row for row in rows}
        self._names = [row.name for row in rows]
        self._microgrids = list(dict.fromkeys(row.microgrid for row in rows if row.microgrid))
        self._spares = [row.name for row in feeder.spares if row.name not in self._rows]
        self._switches = [switch.alias or switch.name for switch in feeder.switches if len(switch.phases) == 3]
        self._loads = list(named_loads(feeder))
        time = scenario.time
        step = time.T_c_s * ceil(1.5 * time.record_s / time.T_c_s - 1e-9)
        self._step = step
        """Distance (s) of the times that are drawn: events apart by it have a recorded row between them."""

    def disturbance(self) -> Disturbance:
        """Draw one."""
        kinds: list[Make] = [_Draw._cut, _Draw._partition, _Draw._delay, _Draw._loss, _Draw._noise, _Draw._pause]
        kinds += [_Draw._slow, _Draw._lie, _Draw._kill, _Draw._leave]
        kinds += [_Draw._join] if self._spares else []
        kinds += [_Draw._load] if self._loads else []
        kinds += [_Draw._switch] if self._switches else []
        make: Make = self._one_of(kinds)
        return make(self)

    # ---------------------------------------------------------------- numbers

    def _one_of(self, these: Sequence[Any]) -> Any:
        return these[self._pick(len(these))]

    def _begin(self) -> float:
        """Draw when it begins (s)."""
        first = ceil(BEGIN_S / self._step - 1e-9)
        last = int((self._base.settled_s + AFTER_S) / self._step)
        return self._time(first + self._pick(max(1, last - first + 1)))

    def _end(self, begin: float) -> float:
        """Draw when what begins at a time ends (s)."""
        return self._time(round(begin / self._step) + 1 + self._pick(round(LONGEST_S / self._step)))

    def _time(self, steps: int) -> float:
        return round(steps * self._step, 9)

    def _span(self) -> dict[str, float]:
        begin = self._begin()
        return {"from_s": begin, "to_s": self._end(begin)}

    # ---------------------------------------------------------------- links

    def _on(self) -> str:
        """Draw which links."""
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

    def _pause(self) -> Disturbance:
        return Disturbance(table="node", entry={"name": self._one_of(self._names), **self._span(), "pause": True})

    def _slow(self) -> Disturbance:
        slow_s = round(0.01 * (1 + self._pick(20)), 3)
        return Disturbance(table="node", entry={"name": self._one_of(self._names), **self._span(), "slow_s": slow_s})

    def _kill(self) -> Disturbance:
        entry = {"name": self._one_of(self._names), "from_s": self._begin(), "kill": True}
        return Disturbance(table="node", entry=entry)

    def _lie(self) -> Disturbance:
        name = self._one_of(self._names)
        lie = self._words_of(round(self._rows[name].P_rated * 0.05 * (1 + self._pick(20)), 3))
        others = [it for it in self._names if it != name]
        reach = self._pick(4)
        if reach == 2:
            lie |= {"plant": True}
        elif reach == 3 and others and self._base.scenario.security == "none":
            lie |= {"in_name_of": self._one_of(others)}
        return Disturbance(table="node", entry={"name": name, **self._span(), "lies": lie})

    def _words_of(self, size: float) -> dict[str, Any]:
        """Draw a lie; `size` is its power (W, var) where it has one."""
        kinds: list[dict[str, Any]] = [
            {"model": "offset", "P_set_W": size, "Q_var": size},
            {"model": "offset", "P_set_W": -size, "V_set_V": 100.0},
            {"model": "scale", "P_set": 0.5, "Q": -1.0},
            {"model": "freeze"},
            {"model": "replay", "delay_s": 1.0},
            {"model": "random", "P_set_W": size, "Q_var": size},
            {"model": "random", "P_set_W": size, "V_set_V": 50.0, "two_faced": True},
            {"model": "extreme", "side": "high"},
            {"model": "extreme", "side": "alternate"},
        ]
        return dict(self._one_of(kinds))

    # ---------------------------------------------------------------- events

    def _event(self, there: dict[str, Any], back: dict[str, Any]) -> Disturbance:
        """Draw an event, and whether and when it is taken back."""
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
        """Set neighbouring loads of the table."""
        first = self._pick(len(self._loads))
        names = self._loads[first : first + 1 + self._pick(MOST_LOADS)]
        factor = self._one_of([0.0, 0.5, 1.5, 2.0])
        there = {name: {"factor": factor} for name in names}
        return self._event({"load": there}, {"load": {name: {"factor": 1.0} for name in names}})

    def _switch(self) -> Disturbance:
        """Open or close a switch; who closes it waits for synchronism."""
        switch = self._one_of(self._switches)
        opens, closes = {"open": [switch]}, {"close": [switch], "synchronised": True}
        return self._event(opens, closes) if self._pick(3) else self._event(closes, opens)
