"""Several nodes in one process, behind one session. Pure.

A group looks like one node to its driver. Messages between its nodes stay inside; a message from outside arrives once
and goes to every node with a route for it. The nodes hold one token each, so the others see as many agents.

**Queries.** A node queries a process for its nameplate after it has subscribed to that process: the answer proves that
the subscription is known (`gridpeers.agents.roster_meeting`). A query proves the same for every subscription that was
declared before it, so nodes share a query, or its answer, unless the group has declared a subscription in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from gridpeers.wire.node import CLOCK_ALONE, Action, Core, Fetch, Listen, Log, Loss, Publish, WithdrawToken


class GroupedNode(Core, Protocol):
    session_broken: bool
    siblings: set[str]
    """Agents of the same process, whose messages do not come from outside."""

    @property
    def name(self) -> str: ...
    @property
    def token(self) -> str: ...
    @property
    def nameplate(self) -> tuple[str, bytes]: ...
    @property
    def publications(self) -> tuple[str, ...]: ...


class _Query(NamedTuple):
    """The last query of a key."""

    declared: int
    askers: list[GroupedNode]
    answer: list[bytes]


class NodeGroup:
    def __init__(self, nodes: Sequence[GroupedNode]) -> None:
        self.nodes = tuple(nodes)
        self.nameplates = dict(node.nameplate for node in nodes)
        names = frozenset(node.name for node in nodes)
        for node in nodes:
            node.siblings.update(names)
        self._now = 0.0
        self._start_anew()

    def _start_anew(self) -> None:
        self._active = list(self.nodes)
        self._declared: set[str] = set()
        self._listeners: dict[str, list[GroupedNode]] = {}
        self._queries: dict[str, _Query] = {}
        self._open: dict[str, _Query] = {}
        """Queries without an answer, by the key under which it will arrive."""
        self._asked = 0

    @property
    def tokens(self) -> tuple[str, ...]:
        return tuple(node.token for node in self._active)

    @property
    def publications(self) -> tuple[str, ...]:
        return tuple(key for node in self.nodes for key in node.publications)

    @property
    def subscriptions(self) -> tuple[str, ...]:
        for node in self._active:
            for key in node.subscriptions:
                self._listen(node, key)
        keys = tuple(self._listeners)
        self._declared.update(keys)
        return keys

    @property
    def watched(self) -> str:
        return self.nodes[0].watched

    @property
    def finished(self) -> bool:
        """Whether to close: all nodes have finished, or one needs another session."""
        return self.session_broken or not self._active

    @property
    def session_broken(self) -> bool:
        return any(node.session_broken for node in self.nodes)

    @property
    def messages_needed(self) -> int:
        least = CLOCK_ALONE
        for node in self._active:  # each counts its awaited messages
            if (least := min(least, node.messages_needed)) == 1:
                break
        return least

    @property
    def deadline(self) -> float | None:
        return min((node.deadline for node in self._active if node.deadline is not None), default=None)

    def start(self, now: float) -> None:
        """Start all nodes; after a broken session, let those begin again that had no problem themselves, too."""
        self._now = now
        if self.session_broken:
            for node in self.nodes:
                node.session_broken = node.session_broken or not node.finished
        self._start_anew()
        self._active = [node for node in self.nodes if node.session_broken or not node.finished]
        for node in self._active:
            node.start(now)
        for node in self._active:
            for other in self._active:
                if other is not node:
                    node.appeared(other.token, now)

    def take_actions(self) -> list[Action | Log]:
        """Take out the actions of all nodes; what concerns the group alone is done on the way."""
        actions: list[Action | Log] = []
        goes_on = True
        while goes_on:  # what stays inside leads to further actions
            before = len(actions)
            for node in tuple(self._active):
                for action in node.take_actions():
                    self._perform(node, action, actions)
            goes_on = self._let_go(actions) or len(actions) > before
        return actions

    def take_rejects(self) -> tuple[str, ...]:
        return tuple(line for node in self.nodes for line in node.take_rejects())

    def appeared(self, key: str, now: float) -> None:
        if key not in self.tokens:
            self._now = now
            for node in self._active:
                node.appeared(key, now)

    def vanished(self, key: str, now: float) -> None:
        if key not in self.tokens:
            self._now = now
            for node in self._active:
                node.vanished(key, now)

    def received(self, key: str, payload: bytes, now: float) -> None:
        self._now = now
        query = self._open.pop(key, None)
        if query is not None:
            query.answer.append(payload)
            key = key.partition("#")[0]
        for node in tuple(self._listeners.get(key, ())) if query is None else query.askers:
            node.received(key, payload, now)

    def lost(self, loss: Loss, now: float) -> None:
        """As `Post.lost`; who waits for a lost answer asks again."""
        query = self._open.pop(loss.key, None)
        if query is not None:
            self._queries.pop(loss.key.partition("#")[0], None)
        for node in self._listeners.get(loss.key, ()) or self._active[:1]:
            node.lost(loss, now)

    def work(self, now: float) -> bool:
        self._now = now
        return any([node.work(now) for node in self._active])

    def expire(self, now: float) -> None:
        self._now = now
        for node in self._active:
            if node.deadline is not None and now >= node.deadline:
                node.expire(now)

    def _perform(self, node: GroupedNode, action: Action | Log, actions: list[Action | Log]) -> None:
        if isinstance(action, Publish):
            actions.append(action)
            for other in tuple(self._listeners.get(action.key, ())):
                if other is not node:
                    other.received(action.key, action.payload, self._now)
        elif isinstance(action, Listen):
            self._listen(node, action.key)
            if action.key not in self._declared:
                self._declared.add(action.key)
                actions.append(action)
        elif isinstance(action, Fetch):
            self._fetch(node, action.key, actions)
        else:
            actions.append(action)

    def _listen(self, node: GroupedNode, key: str) -> None:
        listeners = self._listeners.setdefault(key, [])
        if node not in listeners:
            listeners.append(node)

    def _fetch(self, node: GroupedNode, key: str, actions: list[Action | Log]) -> None:
        """Answer from inside, or by a query that proves as much, or query; a node that asks again has had no answer."""
        own = self.nameplates.get(key)
        query = self._queries.get(key)
        if own is not None:
            node.received(key, own, self._now)
        elif query is None or query.declared != len(self._declared) or (node in query.askers and not query.answer):
            self._asked += 1
            query = self._queries[key] = _Query(len(self._declared), [node], [])
            reply_key = f"{key}#{self._asked}"
            self._open[reply_key] = query
            actions.append(Fetch(key, reply_key))
        elif query.answer:
            node.received(key, query.answer[0], self._now)
        else:
            query.askers.append(node)

    def _let_go(self, actions: list[Action | Log]) -> bool:
        """Withdraw the tokens of nodes that have finished; to the others inside they are gone. Return if any has."""
        ended = [node for node in self._active if node.finished and not node.session_broken]
        for node in ended:
            actions.extend(node.take_actions())
            self._active.remove(node)
            for listeners in self._listeners.values():
                if node in listeners:
                    listeners.remove(node)
            actions.append(WithdrawToken(node.token))
            for other in self._active:
                other.vanished(node.token, self._now)
        return bool(ended)
