"""Requests about the emulated links of a live run: commands to them, their status, and the table of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.emulation.link_command import LinkCommand
from gridpeers.scenarios.emulation.link_data import EmulationConfig, LinkStatus, decode_statuses
from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.scenarios.live.run_client import NobodyError, RunClient
from gridpeers.scenarios.live.run_requests import configurations, data_of, request
from gridpeers.scenarios.short_texts import aligned, in_order
from gridpeers.wire.messages import PLANT, Answer, LinkAcknowledgement
from gridpeers.wire.schema.table_schema import Problem


class _LinkReply(msgspec.Struct, frozen=True):
    """The plant's answer to "link" and "links"; see `gridpeers.plant.realtime.run_commands`."""

    number: int
    t: float
    asked: tuple[str, ...]
    receivers: tuple[str, ...] = ()

    @property
    def reached(self) -> tuple[str, ...]:
        """Receivers of a command that take part: the plant, and the agents that it has sent the command."""
        return tuple(name for name in self.receivers if name == PLANT or name in self.asked)

    @property
    def answers_needed(self) -> set[str]:
        """Receivers that answer: agents to a command, for which the plant has answered; the plant too to "links"."""
        return {*self.reached} - {PLANT} if self.number > 0 else {*self.asked, PLANT}


@dataclass(frozen=True, kw_only=True)
class LinkCommandResult:
    """The receivers' answers to a link command."""

    t: float
    """Run time (s) from which on it holds."""
    text: str
    """Its effect in words: a heal names only links that had a fault."""
    acknowledged: tuple[str, ...]
    """Receivers that have taken it."""
    silent: tuple[str, ...]
    """Receivers that take part and have not answered in time."""
    absent: tuple[str, ...]
    """Receivers without an agent: the plant tells the agent when it comes."""
    refused: Mapping[str, str]
    """Receivers that have refused, and why."""

    @property
    def changes_links(self) -> bool:
        """Whether it changes any link."""
        return bool(self.acknowledged or self.silent or self.absent or self.refused)


def links_of_run(client: RunClient) -> tuple[EmulationConfig, AgentConfig]:
    """Return the emulated links of a run, and the configuration of one agent; NobodyError if none can be changed."""
    for config in configurations(client).values():
        if config.links:
            return EmulationConfig.of_tree(config.links), config
    raise NobodyError(
        f"{client.where} has no emulated links that could be changed; runs started by gridpeers plant or up have"
    )


def check_link_command(command: LinkCommand, setup: EmulationConfig | None) -> None:
    """Raise UsageError with all that is wrong with a command; without a setup, with its values alone."""
    problems: Iterable[Problem] = command.wrong_values() if setup is None else command.problems(setup.microgrids)
    options = [(path.partition(".")[0], text) for path, text in problems]
    wrong = [f"{'LINKS' if option == 'on' else f'--{option}'}: {text}" if option else text for option, text in options]
    if wrong:
        raise UsageError("; ".join(wrong))


def command_links(client: RunClient, command: LinkCommand) -> LinkCommandResult:
    """Give a command and wait until every receiver concerned has taken it, or for `ACKNOWLEDGED` seconds."""
    answer, answers = _request(client, verb="link", link_command=command.to_tree())
    reply = data_of(client, answer, _LinkReply)
    refused = {name: answers[name].text for name in reply.reached if name in answers and not answers[name].ok}
    silent = tuple(name for name in reply.reached if name != PLANT and name not in answers)
    return LinkCommandResult(
        t=reply.t,
        text=answer.text,
        acknowledged=tuple(name for name in reply.reached if name not in refused and name not in silent),
        silent=silent,
        absent=tuple(name for name in reply.receivers if name not in reply.reached),
        refused=refused,
    )


def link_states(client: RunClient) -> tuple[float, dict[tuple[str, str], LinkStatus], tuple[str, ...]]:
    """Return the run time (s), the state of every link that has or had a fault, and the receivers without an answer."""
    answer, answers = _request(client, verb="links")
    reply = data_of(client, answer, _LinkReply)
    statuses: dict[tuple[str, str], LinkStatus] = {}
    for name, acknowledgement in answers.items():
        if acknowledgement.ok:
            try:
                of_sender: dict[str, LinkStatus] = decode_statuses(acknowledgement.data)
            except msgspec.DecodeError:  # counts as no answer
                continue
            statuses |= {(src, name): state for src, state in of_sender.items()}
    return reply.t, statuses, tuple(name for name in reply.asked if name not in answers)


def _request(client: RunClient, **command_fields: Any) -> tuple[Answer, dict[str, LinkAcknowledgement]]:
    return request(client, lambda answer: data_of(client, answer, _LinkReply).answers_needed, **command_fields)


_HEAD = ("link", "sent", "delivered", "dropped", "now")


def links_text(run: str, t: float, stands: Mapping[tuple[str, str], LinkStatus]) -> str:
    """Return one line for each link that is impaired at t (s), one for all that once were; by sender and receiver."""
    names = in_order({name for link in stands for name in link} - {PLANT})
    order = {name: i for i, name in enumerate([*names, PLANT])}
    now = {link: stands[link] for link in sorted(stands, key=lambda ends: (order[ends[0]], order[ends[1]]))}
    now = {link: stand for link, stand in now.items() if stand.holds}
    before = [stand for link, stand in stands.items() if link not in now]
    count = "no link is impaired" if not now else f"{len(now)} link{'s' if len(now) > 1 else ''} impaired"
    text = [f"run {run}   t = {t:.2f} s   {count}"]
    rows = [_HEAD, *((f"{src} -> {dst}", *_counts(stand), ", ".join(stand.holds)) for (src, dst), stand in now.items())]
    text += aligned(rows, right=range(1, 4)) if now else ()
    if before:
        books = [stand.counts for stand in before if stand.counts is not None]
        sent, dropped = sum(book.sent for book in books), sum(sum(book.dropped.values()) for book in books)
        text.append(f"impaired before: {len(before)} links; sent over them {sent}, dropped {dropped}")
    return "\n".join(text) + "\n"


def _counts(stand: LinkStatus) -> tuple[str, str, str]:
    book = stand.counts
    if book is None:
        return "0", "0", "0"
    reasons = ", ".join(f"{reason} {count}" for reason, count in sorted(book.dropped.items()))
    return str(book.sent), str(book.delivered), f"{sum(book.dropped.values())}" + (f" ({reasons})" if reasons else "")
