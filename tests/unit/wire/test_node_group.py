"""Nodes that share a session: one declaration, one query and one message for all, and a token each."""

from __future__ import annotations

from gridpeers.wire.codec import RejectedMessages
from gridpeers.wire.node import Action, Fetch, Listen, Log, Publish, WithdrawToken
from gridpeers.wire.node_group import NodeGroup


class Node:
    """A node that the test plays."""

    def __init__(self, name: str, *keys: str) -> None:
        self.name, self.token = name, f"alive/{name}"
        self.rejects = RejectedMessages(name)
        self.routes: dict[str, object] = dict.fromkeys(keys)
        self.session_broken = self.finished = False
        self.nameplate = f"nameplate/{name}", f"I am {name}".encode()
        self.publications: tuple[str, ...] = (f"state/{name}",)
        self.watched = "alive/*"
        self.messages_needed, self.deadline = 1, 10.0
        self.siblings: set[str] = set()
        self.to_do: list[Action | Log] = []
        self.heard: list[tuple[str, bytes]] = []
        self.known: set[str] = set()
        self.starts = 0

    @property
    def subscriptions(self) -> tuple[str, ...]:
        return tuple(self.routes)

    def start(self, now: float) -> None:
        self.starts += 1
        self.session_broken = False

    def take_actions(self) -> list[Action | Log]:
        actions, self.to_do = self.to_do, []
        return actions

    def appeared(self, key: str, now: float) -> None:
        self.known.add(key)

    def vanished(self, key: str, now: float) -> None:
        self.known.discard(key)

    def received(self, key: str, payload: bytes, now: float) -> None:
        self.heard.append((key, payload))

    def work(self, now: float) -> bool:
        return False

    def expire(self, now: float) -> None:
        self.finished = True


def group(*nodes: Node) -> NodeGroup:
    made = NodeGroup(nodes)
    made.start(0.0)
    assert made.subscriptions == tuple(dict.fromkeys(key for node in nodes for key in node.routes))
    return made


def test_a_message_goes_to_every_node_with_a_route_for_it() -> None:
    """The message may come from outside or from another node. A node's own message goes out once and not back to it."""
    a, b = Node("a", "state/b", "state/c"), Node("b", "state/a", "state/c", "measurement/b")
    both = group(a, b)
    a.to_do = [Publish("state/a", b"1")]

    assert both.take_actions() == [Publish("state/a", b"1")]
    both.received("state/c", b"2", 0.0)
    both.received("measurement/b", b"3", 0.0)

    assert a.heard == [("state/c", b"2")]
    assert b.heard == [("state/a", b"1"), ("state/c", b"2"), ("measurement/b", b"3")]


def test_a_query_is_shared_unless_a_subscription_was_declared_in_between() -> None:
    """The answer to an older query would prove nothing about a younger subscription."""
    a, b = Node("a"), Node("b")
    both = group(a, b)
    a.to_do, b.to_do = [Fetch("nameplate/c")], [Fetch("nameplate/c")]
    (first,) = both.take_actions()
    a.to_do = [Listen("state/c"), Fetch("nameplate/c")]
    _, second = both.take_actions()
    assert isinstance(first, Fetch)
    assert isinstance(second, Fetch)

    both.received(first.reply_key, b"c", 0.0)
    assert (a.heard, b.heard) == ([("nameplate/c", b"c")], [("nameplate/c", b"c")])
    b.to_do = [Listen("state/c"), Fetch("nameplate/c")]
    assert both.take_actions() == []
    both.received(second.reply_key, b"c", 0.0)
    assert len(a.heard) == len(b.heard) == 2

    b.to_do = [Fetch("nameplate/c")]
    assert both.take_actions() == []
    assert len(b.heard) == 3


def test_nodes_inside_meet_without_the_session() -> None:
    """Nodes of one group know the tokens and nameplates of each other from the start."""
    a, b = Node("a"), Node("b")
    both = group(a, b)
    a.to_do = [Fetch("nameplate/b")]

    assert both.take_actions() == []
    both.appeared("alive/a", 0.0)
    both.vanished("alive/b", 0.0)

    assert (a.known, b.known) == ({"alive/b"}, {"alive/a"})
    assert a.heard == [("nameplate/b", b"I am b")]
    assert a.siblings == {"a", "b"}


def test_a_node_that_has_finished_takes_its_token_along() -> None:
    """The other nodes continue. The group finishes with its last node."""
    a, b = Node("a"), Node("b")
    both = group(a, b)
    a.finished, a.to_do = True, [Publish("state/a", b"last")]

    assert both.take_actions() == [Publish("state/a", b"last"), WithdrawToken("alive/a")]
    assert (both.finished, b.known, both.tokens) == (False, set(), ("alive/b",))
    both.expire(10.0)
    assert both.take_actions() == [WithdrawToken("alive/b")]
    assert both.finished


def test_a_broken_session_is_renewed_for_all() -> None:
    """If one node hears nothing, the session is closed, and every unfinished node starts again."""
    a, b, c = Node("a"), Node("b"), Node("c")
    all_three = group(a, b, c)
    c.finished = True
    all_three.take_actions()
    a.session_broken = True

    assert all_three.finished
    assert all_three.session_broken
    all_three.start(1.0)

    assert (a.starts, b.starts, c.starts) == (2, 2, 1)
    assert not all_three.finished
    assert all_three.tokens == ("alive/a", "alive/b")
