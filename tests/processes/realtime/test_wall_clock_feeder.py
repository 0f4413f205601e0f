"""The paper's feeder in wall-clock time: it islands, one inverter leaves and returns, one is new.

The run keeps half of real time, so that a machine which does other things beside it still keeps pace.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.live.live_options import LiveOptions, configure
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from tests.toy.toy_runs import ProcessRun

REAL = ("-m", "gridpeers.scenarios.emulation.emulated_plant")


class Feeder:
    """Case IV of the islanding experiment in wall-clock time, without its second event."""

    def __init__(self, folder: Path, end: float) -> None:
        scenario, feeder = load_scenario("islanding")
        scenario = replace(scenario, events=scenario.events[:1])
        self.endpoint = free_endpoint()
        plant, agents = configure(
            scenario, feeder, LiveOptions(run="feeder", case="IV", duration=end, speed=0.5), self.endpoint
        )
        self.agents = {agent.name: replace(agent, connect=(self.endpoint,)) for agent in agents}
        self.rated = [agent.P_rated for agent in agents]
        standing = [self.agents[name] for name in plant.agents]
        self.folder = folder
        self.run = ProcessRun(plant, standing, folder)

    def start(self, name: str) -> None:
        """Start an agent of a name while the run goes on."""
        assert self.run.children is not None
        log = self.folder / f"{name}-again.log"
        child = Child(
            name, ["-m", "gridpeers.scenarios.emulation.emulated_agent"], self.agents[name], log, lambda child: None
        )
        before = [child for child in self.run.children if child.name == name]
        for former in before:
            former.release()
        self.run.children.add(child)
        self.run.pids.append(child.pid)

    def __call__(self) -> Outcome:
        """Run until the plant is asked to end, and print the pace for whoever reads of a failure."""
        outcome = self.run(plant_command=REAL)
        print(f"pace: {outcome.pacing}")
        assert outcome.broke == "the plant was asked to leave: SIGTERM"
        return outcome

    def once_restored(self, event: str, of: set[int], do: Callable[[], None]) -> None:
        """Do something as soon as these inverters are in their band for 0.2 s after an event."""
        self.run.once(lambda: self.restored(self.run.time_of(event), of) < float("inf"), do)

    def restored(self, since: float, of: set[int], until: float = float("inf")) -> float:
        """Time (s) after `since` from which these inverters are within 0.01 Hz and share within 0.02 pu for 0.2 s.

        Infinite if that is not so by `until`: the row at the time of an event is of before it.
        """
        rows = [row for row in self.run.rows if since <= row[0] <= until]
        held = [(row[0], self._in_band(row, of)) for row in rows]
        began = since
        for t, ok in held:
            if not ok:
                began = t
            elif t - began >= 0.2:
                return began - since
        return float("inf")

    def _in_band(self, row: tuple[float, ...], of: set[int]) -> bool:
        errors = [abs(row[1 + 6 * (i - 1)] - 60.0) for i in of]
        shares = [row[2 + 6 * (i - 1)] / self.rated[i - 1] for i in of]
        return max(errors) < 0.01 and max(shares) - min(shares) < 0.02


def test_inverters_come_leave_return_and_lose_their_agents(tmp_path: Path) -> None:
    """After each of it 60 Hz within 0.01 Hz and equal sharing of those present within 1 s.

    A tenth inverter nobody has heard of comes on line with its agent; one leaves and returns, the paper's plug-n-play;
    a follower is killed: its set-points stay, the others share among themselves and keep the frequency.
    """
    feeder, nine, ten = Feeder(tmp_path, end=45.0), set(range(1, 10)), set(range(1, 11))
    feeder.once_restored("switch 13-152 opened", nine, lambda: feeder.start("inv10"))
    feeder.once_restored("inv10 connected", ten, lambda: feeder.run.child("inv2").signal(signal.SIGTERM))
    feeder.once_restored("inv2 disconnected", ten - {2}, lambda: feeder.start("inv2"))
    feeder.once_restored("inv2 connected", ten, lambda: feeder.run.child("inv3").signal(signal.SIGKILL))
    feeder.once_restored("inv3 died", ten - {3}, lambda: feeder.run.child("plant").signal(signal.SIGTERM))
    outcome = feeder()
    came, left, back, died = map(
        feeder.run.time_of, ("inv10 connected", "inv2 disconnected", "inv2 connected", "inv3 died")
    )
    held = {row[5 + 6 * 2] for row in feeder.run.rows if row[0] > died + 0.1}

    assert feeder.restored(came, ten, left) < 1.0
    assert feeder.restored(left, ten - {2}, back) < 1.0
    assert feeder.restored(back, ten, died) < 1.0
    assert feeder.restored(died, ten - {3}) < 1.0
    assert len(held) == 1
    assert all(note.startswith("inv3 was killed") for note in outcome.notes)
