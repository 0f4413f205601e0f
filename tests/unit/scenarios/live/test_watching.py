"""A run on a terminal: as text, as a table, and the one-line diagram of its feeder."""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.plant.equipment.named_loads import named_loads
from gridpeers.scenarios.live.feeder_map import FeederMap, feeder_map, read_feeder_map
from gridpeers.scenarios.live.live_options import configure
from gridpeers.scenarios.live.run_monitor import InverterStatus, PlantStatus, RunMonitor, Snapshot
from gridpeers.scenarios.live.watching import plain
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.messages import AgentStatus, Pacing, PlantEvent, Telemetry

PACING = Pacing(steps=200, late=0, p50=1e-4, p95=2e-4, p99=1e-3, worst=0.1, slipped=0.0)


def plate(name: str) -> AgentConfig:
    """An inverter of 500 kW and 2400 V."""
    return AgentConfig(
        run="lab", name=name, kind="GFM", microgrid="MG1", P_rated=5e5, V_nom=2400.0, f_nom=60.0, m_p=0.01, m_q=0.05,
        T_c=0.02, control=Control(secondary="all", graph="full"), deadline=10.0, connect=(),
    )  # fmt: skip


def told(t: float, *events: PlantEvent, life: int = 1) -> Telemetry:
    """Telemetry of two inverters at a time (s)."""
    return Telemetry(
        sender="plant", epoch=life, seq=0, t=t, inverters=("inv1", "inv2"),
        rows=((t, 60.01, 3e5, 1e4, 2400.0, 3.1e5, 2412.0, 60.0, 2.5e5, -2e4, 2376.0, 2.5e5, 2400.0),),
        events=events, final=False, outcome="", reproducible=False,
        pacing=PACING,
    )  # fmt: skip


def status(sender: str, neighbours: dict[str, float], used: tuple[str, ...], waits_for: str = "") -> AgentStatus:
    """How an agent fares that hears neighbours at ages (s)."""
    return AgentStatus(
        sender=sender, epoch=1, seq=5, t=2.0, phase="waiting" if waits_for else "running", waits_for=waits_for,
        island="grid", neighbours=tuple(neighbours), ages=tuple(neighbours.values()), used=used, received=120, sent=60,
        rejected=0, lost=2, ticks=60, missed=0, lateness=0.001,
    )  # fmt: skip


def monitor() -> RunMonitor:
    """Two inverters, of which the first has an agent that hears nobody."""
    seen = RunMonitor("lab")
    for name in ("inv1", "inv2"):
        seen.config(plate(name))
    opened = PlantEvent(t=1.0, kind="switch", subject="13-152", text="13-152 opened")
    command = PlantEvent(t=1.0, kind="command", subject="13-152", text="switch 13-152: open at t = 1.00 s")
    seen.telemetry(told(2.0, command, opened), now=10.0)  # of which one is shown
    seen.status(status("inv1", {"inv2": 1.4}, ()), now=10.0)
    return seen


def test_status_is_a_line_per_agent_with_units() -> None:
    """Run, time, pacing; per agent its numbers, whom it hears, its messages; what happened."""
    text = plain(monitor().snapshot({"inv1"}, now=10.1))

    assert text.splitlines() == [
        "run lab   t = 2.00 s   pace: 100.00 % of steps in time (p50 0.1 ms, p99 1.0 ms)   islands: grid",
        "agent  island    f Hz   P kW  P_set kW   P pu  Q kvar    V pu  V_set pu  hears  age s   in  out  lost",
        "inv1   grid    60.010  300.0     310.0  0.600    10.0  1.0000    1.0050  -          -  120   60     2"
        "  without inv2",
        "inv2   -       60.000  250.0     250.0  0.500   -20.0  0.9900    1.0000  -          -    -    -     -"
        "  no agent",
        "    1.00 s  13-152 opened",
    ]


def test_an_agent_that_the_plant_hears_is_there_though_nothing_comes_from_it_here() -> None:
    """No link to its host: the plant says who takes part, in its status and then in its events, and is believed."""
    seen = monitor()
    joined, died = (
        PlantEvent(t=t, kind="roster", subject="inv2", text=f"inv2 {what}")
        for t, what in ((2.1, "joined"), (2.3, "died"))
    )
    for event, note in ((joined, "not heard here; the plant hears it"), (died, "no agent")):
        seen.telemetry(told(event.t, event), now=10.2)
        assert seen.snapshot({"inv1"}, now=10.2).inverters[1].note == note

    seen.plant_status(PlantStatus(phase="running", t=2.5, speed=1.0, pacing=PACING, agents=("inv1", "inv2")))
    assert seen.snapshot({"inv1"}, now=10.2).inverters[1].note == "not heard here; the plant hears it"
    seen.telemetry(told(0.1, life=2), now=10.4)
    assert seen.snapshot({"inv1"}, now=10.4).inverters[1].note == "no agent"


def test_a_run_that_has_not_begun_shows_who_waits() -> None:
    """Agents are listed by their tokens though the plant has sent nothing."""
    seen = RunMonitor("lab")
    seen.status(status("inv3", {}, (), waits_for="the plant"), now=1.0)

    text = plain(seen.snapshot({"inv3", "inv4"}, now=1.0))

    assert text.startswith("run lab   has not begun")
    assert text.splitlines()[2].endswith("waits for the plant")
    assert text.splitlines()[3].endswith("has not reported yet")


def numbers(line: InverterStatus) -> set[float | None]:
    return {line.f, line.P, line.P_set, line.P_share, line.Q, line.V, line.V_set}


def test_after_the_end_of_a_run_no_number_of_it_is_shown_as_if_it_went_on() -> None:
    """With the last telemetry powers, pace and impaired links are gone; when it ended, and why it broke, is there."""
    ended, broke = monitor(), monitor()
    ended.telemetry(replace(told(2.2), final=True, impaired=("inv1",)), now=10.2)
    broke.telemetry(replace(told(2.2), final=True, outcome="the deadline of inv1 passed"), now=10.2)
    look = ended.snapshot((), now=10.3)

    assert [numbers(line) for line in look.inverters] == [{None}, {None}]
    assert (look.t, look.pace, look.impaired) == (2.2, "the run has ended", ())
    assert plain(look).splitlines()[2].split() == ["inv1", *"-" * 13, "no", "agent"]
    assert broke.snapshot((), now=10.3).pace == "the run has ended: the deadline of inv1 passed"


def test_impaired_links_are_shown_only_while_there_are_any() -> None:
    """A column of few characters, and a word in the first line of whom the plant hears badly; else nothing of it."""
    hurt = InverterStatus(name="inv4", impaired=("inv1", "inv7", "plant"))
    calm = Snapshot(run="lab", t=1.0, inverters=(InverterStatus(name="inv4"), InverterStatus(name="inv5")))
    bad = Snapshot(run="lab", t=1.0, inverters=(hurt, InverterStatus(name="inv5")), impaired=("inv2", "inv3", "inv4"))

    assert "impaired" not in plain(calm)
    assert plain(bad).splitlines()[0].endswith("impaired to the plant: inv2-4")
    assert [line.split()[-2:] for line in plain(bad).splitlines()[2:3]] == [["inv1,7", "plant"]]


def test_telemetry_that_is_published_again_for_a_recorder_does_not_turn_the_clock_back() -> None:
    """Telemetry repeated for a recorder does not move the time back; a restarted plant begins at 0 again."""
    seen = monitor()
    seen.telemetry(told(2.2), now=10.2)
    seen.telemetry(told(1.4), now=10.3)
    assert seen.snapshot((), now=10.3).t == 2.2
    seen.telemetry(told(0.2, life=2), now=10.4)
    assert seen.snapshot((), now=10.4).t == 0.2


def test_loads_are_on_the_map_as_the_run_has_them() -> None:
    """Each load of the feeder at its bus, with the scenario's factor on it."""
    scenario, feeder = load_scenario("islanding")
    twice = msgspec.structs.replace(scenario, plant=msgspec.structs.replace(scenario.plant, load_factor=2.0))
    plant, _ = configure(twice, feeder, "tcp/127.0.0.1:7447", run="lab")
    diagram = msgspec.convert(plant.feeder_map, FeederMap)

    assert (diagram.scenario, diagram.case) == ("islanding", "IV")
    assert {load.name: (diagram.buses[load.bus][0], complex(load.P, load.Q)) for load in diagram.loads} == {
        name: (load.bus, 2.0 * load.S) for name, load in named_loads(feeder).items()
    }


def test_a_load_at_a_bus_that_is_not_there_is_no_map() -> None:
    """What comes over the network is not believed."""
    diagram = feeder_map(load_scenario("islanding")[1])
    wrong = msgspec.structs.replace(diagram.loads[0], bus=len(diagram.buses))

    assert read_feeder_map(msgspec.json.encode(diagram)) == diagram
    assert read_feeder_map(msgspec.json.encode(msgspec.structs.replace(diagram, loads=(wrong,)))) is None
