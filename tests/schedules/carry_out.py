"""Carry out a schedule on real processes in wall-clock time, and judge the run by what the plant recorded."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from msgspec.structs import replace

from gridpeers.plant.build import build_plant
from gridpeers.scenarios.live.live_options import LiveOptions, configure
from gridpeers.scenarios.results.record import QUANTITIES
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.messages import PLANT
from tests.schedules.schedule import HEAL, Action, draw
from tests.toy.town import Town

PLANT_COMMAND = ("-m", "gridpeers.scenarios.emulation.emulated_plant")

LONGEST = 20.0
"""Run time (s) after the heal for which the run goes on, if an island does not come back into its band."""

STEADY = 2.0
"""An island is back once it has stayed in its band for so long (s)."""

F_BAND, P_BAND = 0.01, 0.02
"""Band of the frequency (Hz) around nominal, and of the powers (pu of each rating) around each other."""

DARK = "stays de-energised"
"""Of an island: its inverters have tripped and have not entered service again."""

CLOSING = 10.0
"""Longest wait (s) for all processes to leave after `down`."""


@dataclass(frozen=True)
class Verdict:
    """How a run with a schedule went."""

    seed: int
    actions: tuple[Action, ...]
    broke: str
    """Why the run ended before it was told to; empty if it did not."""
    outlived: tuple[str, ...]
    """Agents that were still there `CLOSING` seconds after the plant was told to end."""
    f_range: tuple[float, float]
    """Least and greatest frequency (Hz) of an inverter that was on the network; NaN if one was not finite."""
    back: dict[str, float] = field(default_factory=dict)
    """Of each island with a leader the time (s) from the heal until it was back in its band for good."""
    excused: dict[str, str] = field(default_factory=dict)
    """Islands that need not come back, and why."""
    events: tuple[str, ...] = ()
    """The plant's telemetry."""
    late: float = 0.0
    """Share of the plant's steps that were late."""

    def __str__(self) -> str:
        back = ", ".join(f"{name} {t:.1f} s" for name, t in self.back.items())
        excused = ", ".join(f"{name} {why}" for name, why in self.excused.items())
        low, high = self.f_range
        return (
            f"seed {self.seed}: {self.broke or 'ran to its end'}; back: {back or '-'}; excused: {excused or '-'}; "
            f"f {low:.2f} to {high:.2f} Hz; late {100.0 * self.late:.1f} %"
            + (f"; outlived by {', '.join(self.outlived)}" if self.outlived else "")
        )


def carry_out(seed: int, folder: Path, *, switchings: bool = True) -> Verdict:
    """Run the islanded feeder with nine agents through the schedule of a seed.

    Parameters
    ----------
    seed : int
        Of the schedule.
    folder : Path
        For the logs; it exists.
    switchings : bool
        Whether switches are operated too.
    """
    scenario, feeder = load_scenario("microgrid-switching")
    scenario = replace(scenario, events=scenario.events[:1])
    configs = configure(scenario, feeder, LiveOptions(run=f"schedule{seed}", case="IV"), "tcp/127.0.0.1:0")
    actions = draw(seed, {row.name: row.microgrid for row in feeder.inverters}, switchings=switchings)
    rated = {agent.name: agent.P_rated for agent in configs[1]}
    leaders = {agent.name for agent in configs[1] if agent.kind == "GFM"}
    build_plant(configs[0])  # compiles the inner loop, if need be; its process then finds it
    with Town(0, folder, configs=configs, plant_command=PLANT_COMMAND) as town:
        run = _Run(town, rated, leaders)
        town.all()
        for action in actions:
            run.wait(action.t)
            run.do(action)
        while run.t < HEAL + LONGEST and run.broke is None and not run.is_back():
            run.wait(run.t + 0.5)
        broke, outlived = run.end()
        back, excused = run.judge()
        pacing = None if town.telemetry is None else town.telemetry.pacing
        return Verdict(
            seed=seed,
            actions=actions,
            broke=broke,
            outlived=outlived,
            f_range=run.f_range(),
            back=back,
            excused=excused,
            events=tuple(f"{event.t:.2f} s {event.subject}: {event.text}" for event in town.events),
            late=0.0 if pacing is None or not pacing.steps else pacing.late / pacing.steps,
        )


class _Run:
    """The run under a schedule."""

    def __init__(self, town: Town, rated: dict[str, float], leaders: set[str]) -> None:
        self._town, self._rated, self._leaders = town, rated, leaders
        self._seen, self._seen_at = -1.0, 0.0

    @property
    def t(self) -> float:
        """Run time (s): that of the last telemetry, and what has passed since."""
        if self._town.t != self._seen:
            self._seen, self._seen_at = self._town.t, monotonic()
        return self._seen + min(1.0, monotonic() - self._seen_at)

    @property
    def broke(self) -> str | None:
        """How the plant's process ended; None while it runs."""
        child = self._town.children[PLANT]
        return None if child.status is None else child.report(f"after t = {self._town.t:.2f} s")

    def wait(self, t: float) -> None:
        """Let the run go on to t (s), or to its end."""
        self._town.until(lambda: self.t >= t or self.broke is not None, f"t = {t:g} s")

    def do(self, action: Action) -> None:
        """Carry out one action, if the run still goes on."""
        if self.broke is not None:
            return
        town, (_, kind, subject) = self._town, action
        if not isinstance(subject, str):
            self._command(kind, subject)
        elif kind == "start":
            town.start(subject)
        elif kind in ("kill", "freeze", "thaw"):
            number = {"kill": signal.SIGKILL, "freeze": signal.SIGSTOP, "thaw": signal.SIGCONT}[kind]
            town.signal(subject, number)
        else:
            self._command(kind, subject)

    def _command(self, verb: str, argument: str | dict[str, Any]) -> None:
        """Give the plant a command; it need not answer if it ends meanwhile."""
        try:
            self._town.command(verb, argument)
        except AssertionError:
            if self.broke is None:
                raise

    def end(self) -> tuple[str, tuple[str, ...]]:
        """End the run, if it still goes on: why it broke before, and which agents have not left."""
        broke = self.broke or ""
        if not broke:
            self._town.command("down")
        end = monotonic() + CLOSING
        names = [*self._rated, PLANT]
        latest = {child.name: child for child in self._town.children if child.name in names}
        stayed = tuple(name for name, child in latest.items() if not child.join(end))
        return broke, stayed

    # ---------------------------------------------------------------- judging

    def _columns(self, quantity: str) -> tuple[tuple[str, ...], np.ndarray]:
        telemetry = self._town.telemetry
        assert telemetry is not None
        rows = np.array(self._town.rows)
        k = QUANTITIES.index(quantity)
        return telemetry.inverters, rows[:, 1 + k :: len(QUANTITIES)]

    def _islands(self) -> dict[str, list[str]]:
        """Inverters of each island, as their agents know them."""
        found: dict[str, list[str]] = {}
        for name, status in self._town.status.items():
            found.setdefault(status.island, []).append(name)
        return found

    def is_back(self) -> bool:
        """Whether all agents run again, no leader stands in the dark, and every island has been back for a while."""
        running = {name for name, status in self._town.status.items() if status.phase == "running"}
        if self._town.t < HEAL + STEADY or running != {*self._town.plant_config.agents}:
            return False
        back, excused = self.judge()
        until = self._town.t - STEADY - HEAL
        return all(t <= until for t in back.values()) and DARK not in excused.values()

    def judge(self) -> tuple[dict[str, float], dict[str, str]]:
        """When each island with a leader came back (s after the heal), and who is excused."""
        if len(self._town.rows) < 2:
            return {}, {}
        t = np.array([row[0] for row in self._town.rows])
        names, f = self._columns("f_Hz")
        P = self._columns("P_W")[1]
        Q = self._columns("Q_var")[1]
        on = (P[-1] != 0.0) | (Q[-1] != 0.0)
        back: dict[str, float] = {}
        excused: dict[str, str] = {}
        for island, members in self._islands().items():
            present = [name for name in members if on[names.index(name)]]
            at = [names.index(name) for name in present]
            p = P[:, at] / np.array([self._rated[name] for name in present])
            if island in ("", "grid"):
                excused[island or "unknown"] = "is on the grid" if island else "is not told"
            elif not present:
                excused[island] = DARK
            elif not self._leaders & set(present):
                excused[island] = "has no leader"
            elif p[-1].min() > 0.97 or p[-1].max() < 0.03:
                excused[island] = f"is at its limits ({p[-1].min():.2f} to {p[-1].max():.2f} pu)"
            else:
                outside = (np.abs(f[:, at] - 60.0).max(axis=1) > F_BAND) | (p.max(axis=1) - p.min(axis=1) > P_BAND)
                last = np.flatnonzero(outside)
                came = t[last[-1]] if last.size else 0.0
                back[island] = float("inf") if came >= t[-1] - 0.2 else max(0.0, float(came) - HEAL)
        return back, excused

    def f_range(self) -> tuple[float, float]:
        """Least and greatest frequency (Hz) of inverters on the network; NaN if a number is not finite."""
        if not self._town.rows:
            return float("nan"), float("nan")
        f = self._columns("f_Hz")[1]
        P, Q = self._columns("P_W")[1], self._columns("Q_var")[1]
        f = f[(P != 0.0) | (Q != 0.0)]
        return float(f.min()), float(f.max())


def summary(verdicts: Sequence[Verdict]) -> str:
    """Numbers of many runs."""
    back = sorted(t for verdict in verdicts for t in verdict.back.values())
    broke = [verdict.seed for verdict in verdicts if verdict.broke]
    outlived = [verdict.seed for verdict in verdicts if verdict.outlived]
    slow = sum(t > 6.0 for t in back)
    never = sum(t == float("inf") for t in back)
    finite = [t for t in back if t < float("inf")] or [float("nan")]
    quantiles = ", ".join(f"p{q} {np.quantile(finite, q / 100):.1f} s" for q in (50, 90, 99))
    return (
        f"{len(verdicts)} runs; broke: {broke or 'none'}; outlived by agents: {outlived or 'none'}; "
        f"{len(back)} islands came back ({quantiles}), {slow} later than 6 s, of these {never} never"
    )
