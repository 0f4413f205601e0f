"""Who takes part in a run in simulated time, and what is to be done when that changes."""

from __future__ import annotations

from typing import Literal

from msgspec.structs import replace

from plant.config import Move
from plant.lockstep.roster import Ask, Break, Connect, Dismiss, Note, Refuse, Roster
from plant.schedule import Schedule
from tests.toy.toy_configs import agent_config, toy_configs
from wire.messages import Nameplate
from wire.patience import Awaited

INVERTERS = ("inv1", "inv2", "inv3", "inv4")
STAYS = "its inverter stays on primary droop at its last set-points"


def roster(
    *moves: tuple[float, str, Literal["leave", "join", "die"]], spares: tuple[str, ...] = (), there: bool = True
) -> Roster:
    """A roster of four inverters with these moves (t in s), everybody there and on roster 0 or nobody yet."""
    config, _ = toy_configs(4, spares=spares)
    config = replace(config, moves=tuple(Move(t=t, inverter=name, action=action) for t, name, action in moves))
    made = Roster(config.agents, INVERTERS, Schedule(config, INVERTERS))
    if there:
        for name in config.agents:
            made.appeared(name, f"p-{name}", t=0.0, gathering=True)
            made.plates[name] = plate(name)
        made.prepare(incarnation=1, t=0.0)
    return made


def plate(name: str) -> Nameplate:
    """A nameplate of an agent of the toy."""
    config = agent_config(name)
    return Nameplate(
        sender=name, incarnation=1, seq=0, t=0.0, kind=config.kind, microgrid=config.microgrid,
        P_rated=config.P_rated, V_nom=config.V_nom, f_nom=config.f_nom, m_p=config.m_p, m_q=config.m_q,
    )  # fmt: skip


def test_of_two_processes_of_a_name_the_first_takes_part() -> None:
    """It is asked for its nameplate, once; the other is refused."""
    made = roster(there=False)

    assert made.appeared("inv1", "a", t=0.0, gathering=True) == [Ask("inv1", "a")]
    assert made.appeared("inv1", "a", t=0.0, gathering=True) == []
    (step,) = made.appeared("inv1", "b", t=0.0, gathering=True)
    assert isinstance(step, Refuse)
    assert step[:2] == ("inv1", "b")
    assert made.instances == {"inv1": "a"}


def test_who_may_come_depends_on_the_time() -> None:
    """A stranger never, a spare only when the tick is held for it, anybody else only before the start."""
    made = roster((0.1, "inv4", "join"), spares=("inv4",), there=False)

    def reason(name: str, *, gathering: bool) -> str:
        (step,) = made.appeared(name, "a", t=0.1, gathering=gathering)
        return step.reason if isinstance(step, Refuse) else ""

    assert reason("inv9", gathering=True).endswith("only for inv1, inv2, inv3, inv4")
    assert "join later" in reason("inv4", gathering=True)
    assert "the run has begun, at t = 0.1 s" in reason("inv4", gathering=False)
    assert "the run has begun, at t = 0.1 s" in reason("inv1", gathering=False)
    assert reason("inv1", gathering=True) == ""
    made.joining = ("inv4",)
    assert reason("inv4", gathering=False) == ""


def test_tokens_are_missed_before_nameplates() -> None:
    """Who is absent is named, and what of it."""
    made = roster(there=False)
    made.appeared("inv1", "a", t=0.0, gathering=True)
    made.appeared("inv3", "c", t=0.0, gathering=True)
    made.plates["inv3"] = plate("inv3")

    assert made.absent(("inv1", "inv2", "inv3")) == (Awaited("token", "inv2"), Awaited("nameplate", "inv1"))


def test_the_roster_is_in_the_order_of_the_configuration() -> None:
    """Not in that of arrival: sums over it must round alike in every run."""
    made = roster(there=False)
    for name in reversed(INVERTERS):
        made.appeared(name, name.upper(), t=0.0, gathering=True)
    first, second = (made.prepare(incarnation=7, t=0.3) for _ in range(2))

    assert first.roster == INVERTERS
    assert first.instances == ("INV1", "INV2", "INV3", "INV4")
    assert (first.seq, second.seq, first.t, first.incarnation) == (0, 1, 0.3, 7)


def test_who_leaves_is_told_before_its_inverter_goes_off() -> None:
    """All leave, then some die, whose inverters stay; then those who join are announced."""
    made = roster((0.1, "inv1", "die"), (0.1, "inv4", "join"), (0.1, "inv2", "leave"), spares=("inv4",))
    steps, joining = made.move(5, t=0.1)
    left, died = "inv2 leaves at t = 0.1 s, as the scenario says", "inv1 dies at t = 0.1 s, as the scenario says"

    assert steps == [
        Note("inv2", left),
        Dismiss("inv2", "p-inv2", left),
        Connect("inv2", False),
        Note("inv1", f"{died}; {STAYS}"),
        Dismiss("inv1", "p-inv1", f"{died}; {STAYS}"),
        Note("inv4", "inv4 joins at t = 0.1 s, as the scenario says"),
    ]
    assert joining == ("inv4",)
    assert made.changed
    assert made.prepare(incarnation=1, t=0.1).roster == ("inv3",)
    assert not made.changed


def test_a_tick_without_moves_changes_nothing() -> None:
    """No steps, nobody to wait for, the same roster."""
    made = roster((0.1, "inv2", "leave"))

    assert made.move(4, t=0.08) == ([], ())
    assert not made.changed


def test_who_is_there_is_not_awaited_though_it_is_to_join() -> None:
    """An agent that leaves and joins at one tick is awaited anew; one that has never left is not."""
    made = roster((0.1, "inv1", "join"), (0.1, "inv2", "leave"), (0.1, "inv2", "join"))
    _, joining = made.move(5, t=0.1)

    assert joining == ("inv2",)


def test_who_is_dismissed_after_its_death_has_no_process_to_be_told() -> None:
    """Its inverter goes off all the same."""
    made = roster((0.1, "inv2", "leave"))
    made.died("inv2", t=0.06, begun=True)
    steps, _ = made.move(5, t=0.1)

    assert [step[1] for step in steps if isinstance(step, Dismiss)] == [""]
    assert Connect("inv2", False) in steps


def test_newcomers_are_put_on_the_network_once() -> None:
    """In the order of the schedule; then nobody is held for any more, and a new roster is due."""
    made = roster()
    made.joining = ("inv4", "inv2")

    assert made.admit() == [Connect("inv4", True), Connect("inv2", True)]
    assert made.joining == ()
    assert made.changed
    assert made.admit() == []


def test_a_death_is_told_while_the_run_goes_on_and_breaks_it_before() -> None:
    """Also that of a newcomer for whom the tick is held; in any case it is off the next roster."""
    made = roster()
    made.joining = ("inv3",)

    assert made.died("inv1", t=0.2, begun=False) == [Break("inv1 died before the run began")]
    assert made.died("inv2", t=0.2, begun=True) == [Note("inv2", f"inv2 died at t = 0.2 s; {STAYS}")]
    assert made.died("inv3", t=0.2, begun=True) == [Break("inv3 died at t = 0.2 s, before it had joined")]
    assert made.changed
    assert set(made.plates) == {"inv4"}
    assert made.prepare(incarnation=1, t=0.2).roster == ("inv4",)
