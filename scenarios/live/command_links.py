"""Orders to the emulated links of a running run: checked, sent, acknowledged; and a look at all links."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from time import monotonic

import msgspec

from agents.agent_config import AgentConfig
from netem.netem_errors import Mistake
from scenarios.emulation.emulation_config import Setup
from scenarios.emulation.link_command import LinkCommand
from scenarios.emulation.link_reports import LinkStand, decode_stands
from scenarios.live.run_address import UsageError
from scenarios.live.run_client import NobodyError, RunClient
from scenarios.live.run_requests import ANSWER, RefusedError, Verb, configurations
from wire.codec import encode
from wire.messages import PLANT, Answer, Command, LinkAnswer

ACKNOWLEDGED = 4.0
"""Longest wait (s) for everybody's word; it takes one control period, or a second more if a message was lost."""


class _Taken(msgspec.Struct, frozen=True):
    """The plant's answer; see `plant.realtime.run_commands`."""

    number: int
    t: float
    asked: tuple[str, ...]
    said: str = ""
    receivers: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of an order."""

    t: float
    """From when on it holds (s of run time)."""
    said: str
    """What it does, in words: a heal names only links that had a fault."""
    acknowledged: tuple[str, ...]
    """Receivers that have taken it."""
    silent: tuple[str, ...]
    """Receivers that are there and have not answered in time."""
    absent: tuple[str, ...]
    """Receivers without an agent: told when it comes."""
    deaf: Mapping[str, str] = field(default_factory=dict)
    """Receivers that have refused, and why."""

    @property
    def changes_links(self) -> bool:
        """Whether it changes what any link does."""
        return bool(self.acknowledged or self.silent or self.absent or self.deaf)


def links_of_run(client: RunClient) -> tuple[Setup, AgentConfig]:
    """What the processes of a run were told of its links, and of one of its agents.

    Raises
    ------
    NobodyError
        If the run has no links that can be changed.
    """
    for config in configurations(client).values():
        if config.links:
            return Setup.of_text(config.links), config
    raise NobodyError(
        f"{client.where} has no emulated links that could be changed; runs started by gridpeers plant or up have"
    )


def check(order: LinkCommand, setup: Setup | None) -> None:
    """Raise UsageError if an order cannot be meant, with all that is wrong; without a setup, of its values alone."""
    _refuse(order.wrong_values() if setup is None else order.mistakes(setup.microgrids))


def _refuse(mistakes: Iterable[Mistake]) -> None:
    options = [(path.partition(".")[0], text) for path, text in mistakes]
    wrong = [f"{'LINKS' if option == 'on' else f'--{option}'}: {text}" if option else text for option, text in options]
    if wrong:
        raise UsageError("; ".join(wrong))


def give(client: RunClient, order: LinkCommand) -> Outcome:
    """Give an order and wait until every receiver that it concerns has taken it, or for `ACKNOWLEDGED` seconds."""
    taken, answers = _ask(client, "link", order.to_text())
    concerned = taken.receivers
    there = [name for name in concerned if name == PLANT or name in taken.asked]
    deaf = {name: answers[name].text for name in there if name in answers and not answers[name].ok}
    return Outcome(
        t=taken.t,
        said=taken.said,
        acknowledged=tuple(name for name in there if name == PLANT or (name in answers and name not in deaf)),
        silent=tuple(name for name in there if name != PLANT and name not in answers),
        absent=tuple(name for name in concerned if name not in there),
        deaf=deaf,
    )


def stands(client: RunClient) -> tuple[float, dict[tuple[str, str], LinkStand], tuple[str, ...]]:
    """How all links stand that do something or once did: run time (s), links, and receivers that did not answer."""
    taken, answers = _ask(client, "links", "")
    found: dict[tuple[str, str], LinkStand] = {}
    for name, answer in answers.items():
        if answer.ok:
            try:
                of_sender: dict[str, LinkStand] = decode_stands(answer.data)
            except msgspec.DecodeError:  # as good as no answer
                continue
            found |= {(src, name): stand for src, stand in of_sender.items()}
    return taken.t, found, tuple(name for name in taken.asked if name not in answers)


def _ask(client: RunClient, verb: Verb, argument: str) -> tuple[_Taken, dict[str, LinkAnswer]]:
    """Give the plant a command; return its answer, and those of the receivers concerned, or of all to a question."""
    command = Command(sender="visitor", incarnation=0, seq=0, t=0.0, verb=verb, argument=argument, reply_to=client.id)
    client.publish(client.keys.command, encode(command))
    taken: _Taken | None = None
    answers: dict[str, LinkAnswer] = {}
    end = monotonic() + ANSWER
    while (left := end - monotonic()) > 0.0:
        for key, payload in client.take(left):
            message = client.read(key, payload)
            if isinstance(message, LinkAnswer):
                answers[message.sender] = message
            elif isinstance(message, Answer):
                if not message.ok:
                    raise RefusedError(message.text)
                taken = msgspec.json.decode(message.text, type=_Taken)
                end = monotonic() + ACKNOWLEDGED
        if taken is not None:
            order = taken.number > 0
            asked = [name for name in taken.receivers if name in taken.asked] if order else [*taken.asked, PLANT]
            if answers.keys() >= set(asked):
                break
    if taken is None:
        raise NobodyError(
            f"the plant of {client.where} is there but has not answered within {ANSWER:g} s; is it frozen?"
        )
    return taken, answers
