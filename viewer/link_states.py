"""State of each communication link, from the receivers' statuses and the accounts of emulated links. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import msgspec

from gridpeers.scenarios.emulation.link_data import LinkStatus
from gridpeers.wire.messages import AgentStatus

State = Literal["used", "old", "apart", "unused"]
"""In the receiver's sums; older than it uses; of another island; left out for another reason."""

AGEING = 0.1
"""Age (s) beyond which the last state of a sender is shown as ageing, though it is still used: five control periods of
20 ms."""

AGE_STEP = 0.05  # Step of the ages of a live run (s): what hardly changes is not sent again


class LinkView(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    src: str
    state: State
    age: float
    """Age (s) of the sender's last state at the receiver, in steps; -1 if none was heard."""
    ageing: bool = False
    """It is used though it is older than `AGEING`."""
    rate: float = 0.0
    """Messages per s of real time that come over it: what the sender sends, less what an emulated link drops."""
    holds: tuple[str, ...] = ()
    """Emulated faults that it has now, in words; "impaired" if they are not known yet."""
    cut: bool = False
    lost: float = 0.0
    """Part of the messages that an emulated link dropped since the account before."""


class LinkStates:
    """Collect what is known of the links of a run; ages come in steps (s)."""

    def __init__(self, age_step: float = AGE_STEP) -> None:
        self._age_step = age_step
        self._sent: dict[str, tuple[float, int, float]] = {}
        """Of each sender: when its last status came (s), its count of sent states, messages per s."""
        self._status: dict[str, AgentStatus] = {}
        self._accounts: dict[str, Mapping[str, LinkStatus]] = {}
        self._lost: dict[tuple[str, str], float] = {}

    def clear(self) -> None:
        self.__init__(self._age_step)  # type: ignore[misc]

    def status(self, message: AgentStatus, now: float) -> None:
        """Take an agent's status; `now` is the client's clock (s)."""
        at, sent, rate = self._sent.get(message.sender, (now, message.sent, 0.0))
        if message.sent < sent:
            at, sent, rate = now, message.sent, 0.0  # another process of that name
        elif now - at > 0.3:  # statuses that a change causes come close together
            at, sent, rate = now, message.sent, _two_digits((message.sent - sent) / (now - at))
        self._sent[message.sender] = at, sent, rate
        self._status[message.sender] = message

    def rates(self, rates: Mapping[str, float], now: float) -> None:
        """Take the messages per s of each sender, where they are known; `now` is the client's clock (s)."""
        for name, rate in rates.items():
            sent = self._status[name].sent if name in self._status else 0
            self._sent[name] = now, sent, _two_digits(rate)

    def accounts(self, receiver: str, statuses: Mapping[str, LinkStatus]) -> None:
        for src, now in statuses.items():
            before = self._accounts.get(receiver, {}).get(src)
            if now.counts is None or before is None or before.counts is None:
                continue
            sent = now.counts.sent - before.counts.sent
            dropped = sum(now.counts.dropped.values()) - sum(before.counts.dropped.values())
            self._lost[src, receiver] = dropped / sent if sent > 0 else self._lost.get((src, receiver), 0.0)
        self._accounts[receiver] = statuses

    @property
    def any_impaired(self) -> bool:
        return any(status.impaired for status in self._status.values())

    def into(self, receiver: str, islands: Mapping[str, str], max_age: float) -> tuple[LinkView, ...]:
        status = self._status.get(receiver)
        if status is None:
            return ()
        views = []
        for src, age in zip(status.neighbours, status.ages, strict=True):
            state: State = "used"
            if src not in status.used:
                apart = islands.get(src, "") not in ("", status.island)
                state = "apart" if apart else "old" if age < 0.0 or age > max_age else "unused"
            views.append(self._view(src, receiver, state, age, impaired=src in status.impaired))
        return tuple(views)

    def _view(self, src: str, receiver: str, state: State, age: float, *, impaired: bool) -> LinkView:
        rate, lost = self._sent.get(src, (0.0, 0, 0.0))[2], 0.0
        holds: tuple[str, ...] = ()
        if impaired:
            account = self._accounts.get(receiver, {}).get(src)
            holds = (account.holds if account is not None else ()) or ("impaired",)
            lost = _two_digits(self._lost.get((src, receiver), 0.0))
        cut = any(hold.startswith(("cut", "partition")) for hold in holds)
        shown = -1.0 if age < 0.0 else round(round(age / self._age_step) * self._age_step, 3)
        return LinkView(
            src=src,
            state=state,
            age=shown,
            ageing=state == "used" and shown > AGEING,
            rate=0.0 if cut or state == "old" else _two_digits(rate * (1.0 - lost)),
            holds=holds,
            cut=cut,
            lost=lost,
        )


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
