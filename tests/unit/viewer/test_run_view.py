"""What the page shows of a run, without a browser: new things once, and nothing old as if it were of now."""

from __future__ import annotations

from math import isclose

import msgspec
import pytest

from gridpeers.netem.ledger import LinkCounts
from gridpeers.scenarios.emulation.link_data import LinkStatus
from gridpeers.scenarios.live.feeder_map import FeederMap, MapInverter, MapSwitch
from gridpeers.scenarios.live.run_monitor import PlantStatus
from gridpeers.viewer.run_view import FROZEN, Cursor, RunView
from gridpeers.viewer.strips import LENGTH, STEP
from gridpeers.wire.messages import AgentStatus, Pacing, PlantEvent, Telemetry
from tests.toy.toy_configs import agent_config

NAMES = ("inv1", "inv2")


def row(t: float, P: float = 3e4) -> tuple[float, ...]:
    """A row of telemetry; the second inverter delivers twice as much."""
    return (t, 60.0, P, 1e3, 277.0, P, 277.0, 60.0, 2 * P, 1e3, 277.0, P, 277.0)


def telemetry(t: float, epoch: int = 7, *events: PlantEvent, final: bool = False, outcome: str = "") -> Telemetry:
    return Telemetry(
        sender="plant", epoch=epoch, seq=0, t=t, inverters=NAMES, rows=(row(t),), events=events, final=final,
        outcome=outcome, reproducible=False, pacing=None,
    )  # fmt: skip


def status(name: str, *, used: tuple[str, ...], age: float = 0.02, sent: int = 0, **others: object) -> AgentStatus:
    (neighbour,) = set(NAMES) - {name}
    fields: dict[str, object] = {
        "phase": "running", "waits_for": "", "island": "inv1", "neighbours": (neighbour,), "ages": (age,), "used": used,
        "received": 0, "sent": sent, "rejected": 0, "lost": 0, "ticks": 0, "missed": 0, "lateness": 0.0,
    }  # fmt: skip
    return AgentStatus(sender=name, epoch=1, seq=0, t=0.0, **(fields | others))  # type: ignore[arg-type]


@pytest.fixture
def view() -> RunView:
    """A view of two inverters, whose plant and agents are there."""
    made = RunView("lab")
    for name in NAMES:
        made.config(agent_config(name))
    made.presence(plant=True, agents=NAMES, now=0.0)
    return made


def test_a_frame_has_what_is_new_and_no_more(view: RunView) -> None:
    """Two pages read at their own pace; each gets every point and event once."""
    event = PlantEvent(t=0.1, kind="switch", subject="13-152", text="switch 13-152 opened")
    view.telemetry(telemetry(0.1, 7, event), 1.0)
    fast, cursor = view.frame(Cursor(), 1.0)
    view.telemetry(telemetry(0.3, 7, event), 1.2)
    second, _ = view.frame(cursor, 1.2)
    slow, _ = view.frame(Cursor(), 1.2)

    assert [point[0] for point in fast.points] == [0.1]
    assert (fast.reset, fast.names, fast.f_nom) == (True, NAMES, 60.0)
    assert [point[0] for point in second.points] == [0.3]
    assert (second.reset, second.names, second.events) == (False, (), ())
    assert [point[0] for point in slow.points] == [0.1, 0.3]
    assert [event.text for event in slow.events] == ["switch 13-152 opened"]
    msgspec.json.encode(slow)


def test_numbers_are_of_now_only_while_the_plant_speaks(view: RunView) -> None:
    """Frozen, gone and ended: no value of the plant stands in the frame, and the page is told since when."""
    view.telemetry(telemetry(1.0), 10.0)
    assert view.frame(Cursor(), 10.1)[0].inverters[0].P == 30.0

    frozen, _ = view.frame(Cursor(), 10.0 + FROZEN + 0.1)
    assert (frozen.live.word, frozen.inverters[0].P, frozen.inverters[0].f) == ("frozen", None, None)
    assert frozen.pace == ""
    view.presence(plant=False, agents=NAMES, now=10.2)
    gone, _ = view.frame(Cursor(), 10.3)
    assert (gone.live.word, gone.live.since, gone.inverters[0].P) == ("gone", 0.3, None)
    view.telemetry(telemetry(1.2, final=True, outcome="it broke"), 10.4)
    ended, _ = view.frame(Cursor(), 10.5)
    assert (ended.live.word, ended.live.text, ended.inverters[0].P) == ("ended", "The run has ended: it broke.", None)


def test_another_plant_begins_anew(view: RunView) -> None:
    """No point, event or link of the former plant stays, and every page is told."""
    event = PlantEvent(t=0.1, kind="switch", subject="13-152", text="switch 13-152 opened")
    view.telemetry(telemetry(5.0, 7, event), 1.0)
    view.status(status("inv1", used=("inv2",)), 1.0)
    pacing = Pacing(steps=1, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)
    view.plant_status(PlantStatus(phase="running", t=5.0, speed=1.0, pacing=pacing))
    _, cursor = view.frame(Cursor(), 1.0)
    assert not view.wants_status

    view.telemetry(telemetry(0.1, 8), 2.0)
    frame, _ = view.frame(cursor, 2.0)

    assert (frame.reset, frame.live.restarts, frame.t) == (True, 1, 0.1)
    assert [point[0] for point in frame.points] == [0.1]
    assert (frame.events, frame.links) == ((), {})
    assert view.wants_status


def test_strips_keep_the_last_seconds_in_per_unit(view: RunView) -> None:
    """Memory is bounded however long a run is, and however many rows a second has."""
    rated, V_nom = agent_config("inv1").P_rated, agent_config("inv1").V_nom
    for k in range(10_000):
        view.telemetry(telemetry(k * 0.01), k * 0.01)
    points = view.frame(Cursor(), 100.0)[0].points

    assert len(points) <= LENGTH / STEP + 1
    assert isclose(points[-1][0] - points[0][0], LENGTH, abs_tol=STEP)
    f1, f2, P1, P2, _, _, V1, _, MPSI, MQSI = points[-1][1]
    assert (f1, f2, V1) == (60.0, 60.0, round(277.0 / V_nom, 4))
    assert (round(3e4 / rated, 4), round(6e4 / rated, 4)) == (P1, P2)
    assert (MPSI, MQSI) == (0.3333, 0.0), "(16) of loads 1 : 2 and equal vars"


def test_strips_keep_the_extremes_between_their_points(view: RunView) -> None:
    """A peak of one row is in the next point, whichever message it comes in, and costs nothing where there is none."""
    for t, f in ((0.0, 60.0), (0.01, 60.79), (0.02, 60.24), (0.05, 60.1), (0.06, 59.2), (0.07, 60.05), (0.1, 60.0)):
        message = msgspec.structs.replace(telemetry(t), rows=((t, f, *row(t)[2:]),))
        view.telemetry(message, t)

    points = view.frame(Cursor(), 0.1)[0].points

    assert [(point[0], point[1][0], point[2]) for point in points] == [
        (0.0, 60.0, {}),
        (0.05, 60.1, {0: (60.1, 60.79)}),
        (0.1, 60.0, {0: (59.2, 60.05)}),
    ]


def test_buses_without_a_source_are_de_energised(view: RunView) -> None:
    """A bus has a path to the substation or to an inverter on the network; the page gets them when they change."""
    view.feeder_map = FeederMap(
        buses=tuple((name, 0.0, 0.0) for name in "abcdef"),
        branches=((0, 1, 3), (2, 3, 3)),
        switches=(MapSwitch("s", "", 1, 2, True), MapSwitch("open", "", 3, 4, False)),
        inverters=(MapInverter("inv1", 3, "GFM", ""), MapInverter("inv2", 4, "GFL", "")),
        source=0,
    )
    pacing = Pacing(steps=1, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)
    status = PlantStatus(phase="running", t=1.0, speed=1.0, pacing=pacing, switches={"s": True})
    view.plant_status(status)
    view.telemetry(telemetry(1.0), 1.0)
    frame, cursor = view.frame(Cursor(), 1.0)
    assert frame.dead == (5,)

    off = (1.1, 60.0, 0.0, 0.0, 0.0, 0.0, 277.0, *row(1.1)[7:])
    view.telemetry(msgspec.structs.replace(telemetry(1.1), rows=(off,)), 1.1)
    again, _ = view.frame(cursor, 1.1)
    view.plant_status(msgspec.structs.replace(status, switches={"s": False}))
    apart, _ = view.frame(cursor, 1.1)

    assert (again.dead, apart.dead) == (None, (2, 3, 5))


def test_an_inverter_off_the_network_has_no_line(view: RunView) -> None:
    """The plant reports exactly no power of it; a line at 0 would say that it idles."""
    message = telemetry(1.0)
    off = (1.0, 60.0, 0.0, 0.0, 277.0, 0.0, 277.0, *row(1.0)[7:])
    view.telemetry(msgspec.structs.replace(message, rows=(off,)), 1.0)

    values = view.frame(Cursor(), 1.0)[0].points[0][1]

    assert values[::2][:4] == (None, None, None, None)
    assert all(value is not None for value in values[1:8:2])


def test_links_say_how_they_are(view: RunView) -> None:
    """Used, old and in another island; cut or lossy with the words of the fault; messages per second as they come."""
    view.status(status("inv2", used=("inv1",), sent=100), 0.0)
    view.status(status("inv2", used=("inv1",), sent=150), 1.0)
    view.status(status("inv1", used=("inv2",)), 1.0)
    used = view.frame(Cursor(), 1.0)[0].links["inv1"][0]
    assert (used.src, used.state, used.age, used.rate, used.cut) == ("inv2", "used", 0.0, 50.0, False)

    view.status(status("inv1", used=(), age=3.0, impaired=("inv2",)), 1.1)
    assert view.any_impaired
    view.accounts("inv1", {"inv2": LinkStatus(holds=("cut",))})
    cut = view.frame(Cursor(), 1.1)[0].links["inv1"][0]
    assert (cut.state, cut.age, cut.rate, cut.holds, cut.cut) == ("old", 3.0, 0.0, ("cut",), True)

    view.status(status("inv1", used=("inv2",), impaired=("inv2",)), 1.2)
    for sent, dropped in ((100, 0), (200, 20)):
        counts = LinkCounts(
            sent=sent, delivered=sent - dropped, duplicated=0, corrupted=0, in_flight=0, dropped={"loss": dropped}
        )
        view.accounts("inv1", {"inv2": LinkStatus(holds=("loss 0.2",), counts=counts)})
    lossy = view.frame(Cursor(), 1.2)[0].links["inv1"][0]
    assert (lossy.lost, lossy.rate, lossy.cut) == (0.2, 40.0, False)

    view.status(status("inv2", used=(), island="inv2"), 1.3)
    view.status(status("inv1", used=()), 1.3)
    assert view.frame(Cursor(), 1.3)[0].links["inv1"][0].state == "apart"


def test_what_is_late_or_off_is_decided_here(view: RunView) -> None:
    """The page has no limits of its own: a link that ages, an age and a voltage in colour, and the speed of the run."""
    pacing = Pacing(steps=10, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)
    view.plant_status(PlantStatus(phase="running", t=1.0, speed=4.0, pacing=pacing))
    high = (1.0, 60.0, 3e4, 1e3, 277.0, 3e4, 277.0, 60.0, 6e4, 1e3, 1.051 * 277.0, 3e4, 277.0)
    view.telemetry(msgspec.structs.replace(telemetry(1.0), rows=(high,)), 1.0)
    seen = {}
    for age in (0.1, 0.15, 0.2):
        view.status(status("inv1", used=("inv2",), age=age), 1.0)
        frame, _ = view.frame(Cursor(), 1.0)
        (link,), (one, other) = frame.links["inv1"], frame.inverters
        seen[age] = link.ageing, one.late, one.hears

    assert seen == {0.1: (False, False, 1), 0.15: (True, False, 1), 0.2: (True, True, 1)}
    assert (one.off_voltage, other.off_voltage, other.hears) == (False, True, None)
    assert frame.speed == 4.0


def test_switches_and_loads_come_when_they_change(view: RunView) -> None:
    """An event asks for them, a page gets them once, and those of a new plant begin anew."""
    pacing = Pacing(steps=1, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)
    as_begun = PlantStatus(phase="running", t=1.0, speed=1.0, pacing=pacing, switches={"13-152": True})
    view.plant_status(as_begun)
    frame, cursor = view.frame(Cursor(), 1.0)
    assert (frame.switches, frame.loads) == ({"13-152": True}, {})
    again, _ = view.frame(cursor, 1.0)
    assert (again.switches, again.loads) == (None, None)

    view.telemetry(telemetry(1.0, 7, PlantEvent(t=1.0, kind="load", subject="48", text="load 48 set")), 1.1)
    assert view.wants_status
    view.plant_status(msgspec.structs.replace(as_begun, loads={"48": (3e5, 1e5)}, switches={"13-152": False}))
    frame, cursor = view.frame(cursor, 1.2)
    assert (frame.switches, frame.loads) == ({"13-152": False}, {"48": (3e5, 1e5)})
    assert not view.wants_status

    view.telemetry(telemetry(0.1, 8), 2.0)
    view.plant_status(as_begun)
    assert view.frame(cursor, 2.0)[0].loads == {}
