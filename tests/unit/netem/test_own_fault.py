"""A fault of somebody's own: where it stands among the others, its numbers, and what becomes of one that fails."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from gridpeers.netem.channel import Channel
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link
from gridpeers.scenarios.emulation.link_data import EmulationConfig, LinkCommand
from gridpeers.wire.plugins.plugin import Plugin

MODULE = '''
from typing import Annotated
from gridpeers import LinkFault, Range, Unit

class Jam(LinkFault):
    """Lose messages in the first part of every second, and delay the others."""
    share: Annotated[float, Range(0, 1), "Part of a second."] = 0.2
    delay: Annotated[float, Unit("s"), Range(0, 1), "Of the others."] = 0.01
    def judge(self, message, draws):
        if message.t % 1.0 < self.share and draws.uniform() < 0.5:
            return None
        return self.delay * draws.uniform(1)

class Late(LinkFault):
    def judge(self, message, draws):
        if message.seq == 3:
            raise RuntimeError("no idea")
        return 0.1

class Leaves(LinkFault):
    def judge(self, message, draws):
        raise SystemExit(3)

class Early(LinkFault):
    def judge(self, message, draws):
        return -0.1

class Deaf(LinkFault):
    def judge(self, message):
        return 0.0
'''
LINK = Link("inv1", "inv2")


@pytest.fixture
def folder(tmp_path: Path) -> str:
    (tmp_path / "my_faults.py").write_text(MODULE, encoding="utf-8")
    return str(tmp_path)


def fault(folder: str, name: str, **values: object) -> Fault:
    own = Plugin(use=f"my_faults:{name}", folder=folder, parameters=tuple(values.pop("parameters", ())))  # type: ignore[arg-type]
    return Fault(on="inv1 -> inv2", own=(own,), **values)  # type: ignore[arg-type]


def channel(entry: Fault, seed: int = 1) -> Channel:
    return Channel(LINK, entry.spans(*LINK, {}), seed)


def test_its_random_numbers_are_the_same_under_every_driver(folder: str) -> None:
    """A message's fate depends on seed, link and number alone, not on which messages were judged before it."""
    entry = fault(folder, "Jam", parameters=(("share", 0.5),))
    one, other = channel(entry), channel(msgspec.json.decode(msgspec.json.encode(entry), type=Fault))
    fates = [one.judge(seq, 0.02 * seq, 100) for seq in range(200)]
    again = {seq: other.judge(seq, 0.02 * seq, 100) for seq in range(0, 200, 3)}
    lost = [fate.reason == "fault" for fate in fates]

    assert [again[seq] for seq in again] == fates[::3]
    assert 25 < sum(lost) < 75
    assert not any(lost[26:50])
    assert fates != [channel(entry, seed=2).judge(seq, 0.02 * seq, 100) for seq in range(200)]


def test_it_adds_delay_and_leaves_the_fates_of_other_faults(folder: str) -> None:
    """It acts after loss: the same messages are lost with it and without it."""
    both = channel(fault(folder, "Jam", delay=0.2, loss=0.3))
    plain = channel(Fault(on="inv1 -> inv2", delay=0.2, loss=0.3))
    pairs = [(both.judge(seq, 0.02 * seq, 100), plain.judge(seq, 0.02 * seq, 100)) for seq in range(100)]

    assert all((ours.reason == "loss") == (theirs.reason == "loss") for ours, theirs in pairs)
    assert all(0.2 < ours.deliveries[0][0] < 0.21 for ours, _ in pairs if ours.deliveries)


@pytest.mark.parametrize(("name", "said"), [
    ("Late", "link fault my_faults:Late on inv1 -> inv2 raised RuntimeError: no idea at t = 0.06 s, message 3; it"),
    (
        "Leaves",
        "my_faults:Leaves on inv1 -> inv2 raised SystemExit: 3 at t = 0 s, message 0; it does nothing from then on",
    ),
    ("Early", "my_faults:Early on inv1 -> inv2 returned -0.1; return a delay from 0 to 3600 s, or None to drop at"),
])  # fmt: skip
def test_a_fault_that_fails_is_ignored_from_then_on_and_reported_once(folder: str, name: str, said: str) -> None:
    """Messages then pass as without it; the report of the link has the sentence."""
    receiver = Receiver("inv2", Netem(links=(fault(folder, name),)), {"inv1": "MG1", "inv2": "MG1"})
    for seq in range(6):
        receiver.offer("inv1", seq, 0.02 * seq, 0.02 * seq, b"state")
    arrived = [round(arrival.delay, 9) for arrival in receiver.due(1.0)]
    (told,) = receiver.take_failures()

    assert sorted(arrived) == ([0.0, 0.0, 0.0, 0.1, 0.1, 0.1] if name == "Late" else [0.0] * 6)
    assert said in told
    assert receiver.take_failures() == ()


def test_a_live_command_cannot_make_a_run_import_a_module(folder: str) -> None:
    """A live command with a user-defined fault is rejected; the setup of a run may contain one."""
    entry = fault(folder, "Jam")
    setup = EmulationConfig(netem=Netem(links=(entry,)), microgrids={"inv1": "MG1"})

    assert EmulationConfig.of_tree(setup.to_tree()) == setup
    with pytest.raises(ValueError, match="a fault of your own is written in the scenario before the run"):
        LinkCommand.of_tree(LinkCommand(fault=entry).to_tree())
