"""Emulated links in real time, with real processes: commanded while the run goes on, and as a scenario says."""

from __future__ import annotations

import math
import re
import signal
from pathlib import Path

from msgspec.structs import replace

from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.ledger import LinkTrace, Outcome
from gridpeers.netem.models.delay import Normal
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.emulation.link_data import EmulationConfig, LinkCommand
from gridpeers.scenarios.results.link_record import LinkRecord
from tests.processes.terminals import Desk
from tests.toy.town import Town
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.toy.toy_runs import by_link

FOUR = ("inv1", "inv2", "inv3", "inv4")
MICROGRIDS = {"inv1": "mg1", "inv2": "mg1", "inv3": "mg1", "inv4": "mg2"}
T_C = 0.02


def setup(*, nodes: tuple[NodeFault, ...] = (), **netem: tuple[Fault | Partition, ...]) -> EmulationConfig:
    return EmulationConfig(netem=Netem(seed=5, nodes=nodes, **netem), microgrids=MICROGRIDS, real_nodes=True)  # type: ignore[arg-type]


def verdicts(trace: LinkTrace) -> list[tuple[float, Outcome]]:
    """Return the time (s) and the fate of each message of a link; each has one fate."""
    assert len({*zip(trace.seq, trace.t, strict=True)}) == len(trace.seq)
    return list(zip(trace.t, trace.outcome, strict=True))


def fates(trace: LinkTrace) -> dict[int, tuple[float, Outcome]]:
    """The same by the number of the message; its sender has one life."""
    assert len({*trace.seq}) == len(trace.seq)
    return dict(zip(trace.seq, verdicts(trace), strict=True))


def simulated(told: EmulationConfig, end: float) -> dict[tuple[str, str], LinkTrace]:
    links = LinkRecord()
    plant, agents = toy_configs(4, end=end)
    plant = replace(plant, links=told.to_tree())
    agents = tuple(replace(agent, links=told.to_tree()) for agent in agents)
    outcome = run_inprocess(plant, agents, lambda telemetry: None, on_other=links, plant=ToyPlant(plant))  # type: ignore[arg-type]  # there are no journals
    assert outcome.broke == ""
    return by_link(links)


def give(town: Town, order: LinkCommand, *receivers: str) -> float:
    """Give a link command and wait until the receivers have taken it; from when on (s) it holds."""
    before = len(town.acknowledgements)
    answer = town.command("link", order.to_tree())
    assert answer.ok, answer.text
    taken = answer.data
    town.until(
        lambda: (
            {other.sender for other in town.acknowledgements[before:] if other.seq == taken["number"]} >= {*receivers}
        ),
        f"order {taken['number']} is taken by {', '.join(receivers)}",
    )
    assert all(other.ok for other in town.acknowledgements[before:])
    return float(taken["t"])


def wait(town: Town, seconds: float) -> None:
    """Let the run go on (s of run time)."""
    until = town.t + seconds
    town.until(lambda: town.t >= until, f"t = {until:g} s")


def test_orders_act_at_the_next_tick_on_every_link_and_on_who_comes_later(tmp_path: Path) -> None:
    """Set, cut and heal hold for all messages of the tick after the plant heard of them, for a restarted agent too.

    And a scenario that says the same gives every message of the same number the same fate in simulated time.
    """
    told = setup()
    with Town(4, tmp_path, links=told.to_tree()).all() as town:
        orders = [
            LinkCommand(fault=Fault(on="inv1 -> inv2", loss=0.3, delay=Normal(mean_s=0.03, std_s=0.01))),
            LinkCommand(fault=Fault(on="inv3 <-> inv4", cut=True)),
            LinkCommand(fault=Fault(on="inv2 -> inv4", delay=0.05)),
        ]
        set_at = give(town, orders[0], "inv2")
        cut_at = give(town, orders[1], "inv3", "inv4")
        delayed_at = give(town, orders[2], "inv4")
        town.until(lambda: town.status["inv4"].impaired == ("inv2", "inv3"), "inv4 tells what is impaired")
        town.signal("inv4", signal.SIGKILL)
        town.until_event("inv4", "inv4 died")
        count = len(town.events)
        town.start("inv4").until_event("inv4", "inv4 joined", after=count)
        town.until(lambda: town.status["inv4"].impaired == ("inv2", "inv3"), "the new inv4 is behind the same links")
        wait(town, 0.6)
        joined_at = next(event.t for event in town.events[count:] if "inv4 joined" in event.text)
        healed_at = give(town, LinkCommand(heal=Heal(on="inv3 <-> inv4", from_s=0.0)), "inv3", "inv4")
        town.until(lambda: town.status["inv4"].impaired == ("inv2",), "inv4 tells that it is healed")
        wait(town, 0.5)
        assert town.command("down").ok
        assert [town.until_ended(name) for name in (*FOUR, "plant")] == [0] * 5
        traces = by_link(town.link_record)

    heard_at = [event.t for event in town.events if event.kind == "command"]
    cut = [*verdicts(traces["inv3", "inv4"]), *verdicts(traces["inv4", "inv3"])]
    assert town.telemetry is not None
    assert town.telemetry.pacing is not None
    late = math.ceil(town.telemetry.pacing.worst / T_C) * T_C  # a plant behind its time acts a period after now
    ahead = [round(order.t - t, 9) for order, t in zip(town.orders, heard_at, strict=True)]
    assert all(T_C <= time <= T_C + late for time in ahead)
    assert {cut_at <= t < healed_at for t, fate in cut if fate == "cut"} == {True}
    assert {fate for t, fate in cut if cut_at <= t < healed_at} == {"cut"}
    assert {fate for t, fate in cut if t >= healed_at} == {0.0}
    assert {fate for t, fate in verdicts(traces["inv2", "inv4"]) if t >= delayed_at} == {0.05}
    assert any(joined_at <= t < healed_at for t, _ in verdicts(traces["inv3", "inv4"]))

    again = setup(links=(replace(orders[0].fault, from_s=set_at),))
    lost = {n: fate for n, (t, fate) in fates(traces["inv1", "inv2"]).items() if t >= set_at}
    by_schedule = {n: fate for n, (t, fate) in fates(simulated(again, 6.0)["inv1", "inv2"]).items() if t >= set_at}
    common = sorted(lost.keys() & by_schedule.keys())
    assert len(common) > 50
    assert [lost[n] for n in common] == [by_schedule[n] for n in common]
    assert {"loss"} < {fate if isinstance(fate, str) else "passed" for fate in lost.values()}


def test_live_links_from_set_to_heal(desk: Desk) -> None:
    """The commands set, cut, status and heal work, and are recorded."""
    listen = desk.options[-1]
    kept = ("--out", "here")
    agents = [desk.open("agent", name) for name in ("inv1", "inv4")]
    for agent in agents:
        agent.expect("looks for the plant of run lab")
    plant = desk.open_bare("plant", "calm.toml", "--run", "lab", "--listen", listen, "--wait", "0", *kept)
    plant.expect("t = 0; speed")
    for agent in agents:
        agent.expect("joins at t = ")

    code, text = desk.type("link", "set", "inv1 -> inv4", "--delay", "0.1", "--jitter", "0.02", "--loss", "0.2")
    slow = r"loss 0.2, delay uniform \(low_s 0.08, high_s 0.12\)"
    said = re.fullmatch(rf"inv1 -> inv4: {slow}; from t = [\d.]+ s on\nacknowledged: inv4\n", text)
    assert code == 0, text
    assert said is not None, text
    plant.expect(rf"link command 1: inv1 -> inv4: {slow}, from t = [\d.]+ s on")
    code, text = desk.type("link", "cut", "inv4", "inv7", "--for", "60")
    assert (code, text.splitlines()[1:]) == (
        0,
        ["acknowledged: inv4", "no agent yet, will be told when it joins: inv7"],
    ), text
    code, text = desk.type("status")
    assert re.search(r"lost +impaired\n", text), text
    assert re.search(r"\ninv4 .* inv1,7( |\n)", text), text
    code, text = desk.type("link", "heal")
    healed, *told = text.splitlines()
    assert (code, told) == (0, ["acknowledged: inv4", "no agent yet, will be told when it joins: inv7"]), text
    assert re.fullmatch(r"all links: 3 links healed; from t = [\d.]+ s on", healed), text
    assert desk.type("down")[0] == 0
    assert plant.end() == 0
    plant.expect(r"emulated links: \d+ messages over \d+ links, dropped: .* \(links.json, links.csv\)")

    case = desk.folder / "here" / "IV"
    assert sorted(path.name for path in case.iterdir()) == [
        "events.csv",
        "history.csv",
        "links.csv",
        "links.json",
        "run.mcap",
    ]
    events = (case / "events.csv").read_text()
    assert events.count(',command,links,"link command ') == 3
