"""The actions of a soak, which disturb its run, drawn from a seed. Pure.

Kinds are dealt from a shuffled deck, and so are the agents that they concern: so even a short run has every kind, and
every agent is replaced early.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple, TypeVar

Kind = Literal["leave", "kill", "spare", "freeze", "cut", "isolate", "part", "impair", "load", "zone"]

DECK: tuple[Kind, ...] = (
    *("leave", "leave", "kill", "kill", "spare", "freeze"),
    *("cut", "cut", "isolate", "part", "impair", "load", "zone"),
)
"""Kinds of one deal: an agent leaves and joins; is killed and restarted; the spare agent joins and leaves; an agent is
frozen; two agents, an agent and all others, or two microgrids are cut off from each other; a link is late and lossy; a
load changes; the passive zone is closed in and opened again."""

LASTS: dict[Kind, tuple[float, float]] = {
    "leave": (1.0, 3.0),
    "kill": (0.5, 3.0),
    "spare": (1.0, 3.0),
    "freeze": (0.5, 3.5),
    "cut": (0.5, 4.0),
    "isolate": (0.5, 4.0),
    "part": (1.0, 5.0),
    "impair": (2.0, 5.0),
    "load": (5.0, 6.0),
    "zone": (5.0, 6.0),
}
"""Shortest and longest time (s) of each. Zenoh closes a silent link after 2 s: a freeze is shorter or longer."""

SETTLE = 5.0
"""Time (s) before a load or a switch changes. Such a change ends a window, at whose end the checks judge steady values,
and vars take so long to settle after an agent has come back."""

REST = (0.3, 1.5)
"""Time (s) between two actions."""

LATE, LOSSY = (0.02, 0.15), (0.05, 0.5)
"""Delay (s) and loss of an impaired link."""

FACTOR = (0.5, 1.5)
"""Of the load that is set."""

_T = TypeVar("_T")


class SoakAction(NamedTuple):
    """What the soak does to the run once, and takes back: commands of a user, or signals to a process."""

    kind: Kind
    agents: tuple[str, ...] = ()
    """The agent, or the two agents or microgrids."""
    seconds: float = 0.0
    """How long it lasts (s)."""
    ends_itself: bool = False
    """Whether a cut has a length, instead of a command that heals it."""
    delay: float = 0.0
    """Of an impaired link (s)."""
    loss: float = 0.0
    """Of an impaired link."""
    factor: float = 1.0
    """Of a load."""
    rest: float = 0.0
    """Time (s) after it."""

    def __str__(self) -> str:
        """In words, e.g. "cut inv1 inv4 for 2.1 s"."""
        return " ".join((self.kind, *self.agents)) + f" for {self.seconds:.1f} s"


def soak_actions(
    seed: int, replaced: Sequence[str], agents: Sequence[str], spare: str, microgrids: Sequence[str]
) -> Iterator[SoakAction]:
    """Yield actions without end, drawn from a seed.

    `replaced` leave, die and freeze; the others of `agents` stay, so that a long life is measured too. `spare` is the
    agent of an inverter that is off at first.
    """
    rng = random.Random(seed)
    kinds, again = _deals(rng, DECK), _deals(rng, replaced)
    pairs = _deals(rng, [(a, b) for i, a in enumerate(agents) for b in agents[i + 1 :]])
    groups = _deals(rng, [(a, b) for i, a in enumerate(microgrids) for b in microgrids[i + 1 :]])
    for kind in kinds:
        match kind:
            case "leave" | "kill" | "freeze":
                concerned: tuple[str, ...] = (next(again),)
            case "isolate":
                concerned = (rng.choice(agents),)
            case "spare":
                concerned = (spare,)
            case "cut" | "impair":
                concerned = next(pairs)
            case "part":
                concerned = next(groups)
            case _:
                concerned = ()
        yield SoakAction(
            kind=kind,
            agents=concerned,
            seconds=round(rng.uniform(*LASTS[kind]), 2),
            ends_itself=rng.random() < 0.5,
            delay=round(rng.uniform(*LATE), 3),
            loss=round(rng.uniform(*LOSSY), 2),
            factor=round(rng.uniform(*FACTOR), 2),
            rest=round(rng.uniform(*REST), 2),
        )


def _deals(rng: random.Random, cards: Sequence[_T]) -> Iterator[_T]:
    """Yield all cards, shuffled, again and again."""
    while True:
        deck = list(cards)
        rng.shuffle(deck)
        yield from deck
