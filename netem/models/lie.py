"""Lies of an agent: the false values that others hear in place of its state. Pure.

Every lie is a valid message, within the bounds of its fields. It keeps the number, the time and the island of the true
state, so that no check of form, order or age stops it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec.structs import replace

from gridpeers.netem.draws import Stream
from gridpeers.netem.models import INSTANT
from gridpeers.wire.messages import Power, State, Voltage
from gridpeers.wire.schema.table_schema import Example, Plausible, Problem, Unit

LONGEST_REPLAY = 60.0  # Longest time (s) by which a replay is old; each receiver keeps the states of that time

Quantity = Literal["P_set", "V_set", "Q"]
QUANTITIES: tuple[Quantity, ...] = ("P_set", "V_set", "Q")  # Quantities of a state that a lie can change

_BOUNDS: dict[str, tuple[float, float]] = {
    name: (get_args(kind)[1].ge, get_args(kind)[1].le)
    for name, kind in (("P_set", Power), ("V_set", Voltage), ("Q", Power))
}
"""Least and greatest value that a message may have (W, V, var)."""

_OFFSET_POWER = Plausible("a false power", -1e11, 1e11)
_OFFSET_VOLTAGE = Plausible("a false voltage", -1e6, 1e6)
_FACTOR = Plausible("a factor of a lie", -1e6, 1e6)
_WIDTH = Plausible("the half width of a random lie", 0.0, 1e11)

Before = Callable[[float], State]
"""From a run time (s) to the sender's last state of then or before; its first one if none is that old."""


class Lie(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
    in_name_of: Annotated[str, Example('"inv5"')] = ""
    """Another inverter, in whose name it lies: that one's states arrive false, its own are true. Empty: its own name.
    Certificates exclude such a lie (docs/understand/guarantees.md)."""
    plant: bool = False
    """true: the plant hears the lie as well, and the inverter follows it; false: only its neighbours hear it."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        """Return the false state that others hear, by a lie that began at `since` (s of run time).

        `before` gives the sender's earlier states, `draw` the random numbers for a quantity.
        """
        raise NotImplementedError

    @property
    def reach(self) -> float | None:
        """How far back (s) it needs earlier states; None: as far as to its beginning."""
        return 0.0


class Offset(Lie, frozen=True, kw_only=True, tag="offset"):
    """Something is added to the true values."""

    P_set_W: Annotated[float, Unit("W"), _OFFSET_POWER] = 0.0
    """Added to the real-power set-point (W)."""
    V_set_V: Annotated[float, Unit("V"), _OFFSET_VOLTAGE] = 0.0
    """Added to the voltage set-point (V)."""
    Q_var: Annotated[float, Unit("var"), _OFFSET_POWER] = 0.0
    """Added to the reactive power (var)."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        values = state.P_set + self.P_set_W, state.V_set + self.V_set_V, state.Q + self.Q_var
        return _with(state, dict(zip(QUANTITIES, values, strict=True)))

    def relations(self) -> list[Problem]:
        return _no_lie(not (self.P_set_W or self.V_set_V or self.Q_var), "P_set_W, V_set_V or Q_var")


class Scale(Lie, frozen=True, kw_only=True, tag="scale"):
    """The true values are multiplied."""

    P_set: Annotated[float, _FACTOR] = 1.0
    """Factor of the real-power set-point."""
    V_set: Annotated[float, _FACTOR] = 1.0
    """Factor of the voltage set-point."""
    Q: Annotated[float, _FACTOR] = 1.0
    """Factor of the reactive power."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        values = state.P_set * self.P_set, state.V_set * self.V_set, state.Q * self.Q
        return _with(state, dict(zip(QUANTITIES, values, strict=True)))

    def relations(self) -> list[Problem]:
        return _no_lie(self.P_set == self.V_set == self.Q == 1.0, "P_set, V_set or Q a factor other than 1")


class _OfQuantities(Lie, frozen=True, kw_only=True):
    of: tuple[Quantity, ...] = QUANTITIES
    """Quantities that the lie changes."""

    def relations(self) -> list[Problem]:
        return [] if self.of else [Problem("of", 'names nothing; write of = ["P_set"], or leave it out for all')]


class Freeze(_OfQuantities, frozen=True, kw_only=True, tag="freeze"):
    """The values stay as they were before the lie began."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        return _from(state, before(since - 2.0 * INSTANT), self.of)

    @property
    def reach(self) -> float | None:
        return None


class Replay(_OfQuantities, frozen=True, kw_only=True, tag="replay"):
    """The values are those of some time ago, under new numbers; bytes with an old number are dropped as stale."""

    delay_s: Annotated[float, Unit("s"), Plausible("the age of a replay", 0.0, LONGEST_REPLAY, above_zero=True)]
    """How long ago (s)."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        return _from(state, before(state.t - self.delay_s), self.of)

    @property
    def reach(self) -> float | None:
        return self.delay_s


class Random(Lie, frozen=True, kw_only=True, tag="random"):
    """Uniform noise of each message, by the seed: true value + (2 u - 1) half width."""

    P_set_W: Annotated[float, Unit("W"), _WIDTH] = 0.0
    """Half width for the real-power set-point (W)."""
    V_set_V: Annotated[float, Unit("V"), _WIDTH] = 0.0
    """Half width for the voltage set-point (V)."""
    Q_var: Annotated[float, Unit("var"), _WIDTH] = 0.0
    """Half width for the reactive power (var)."""
    two_faced: bool = False
    """true: every neighbour hears a different number; false: all hear the same."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        widths = zip(QUANTITIES, (self.P_set_W, self.V_set_V, self.Q_var), strict=True)
        moved = {
            name: getattr(state, name) + (2.0 * draw(name).uniform(state.seq) - 1.0) * width
            for name, width in widths
            if width
        }
        return _with(state, moved)

    def relations(self) -> list[Problem]:
        return _no_lie(not (self.P_set_W or self.V_set_V or self.Q_var), "P_set_W, V_set_V or Q_var")


class Extreme(_OfQuantities, frozen=True, kw_only=True, tag="extreme"):
    """The largest or least values that a message may have: +-1e11 W and var, 1e6 or 0 V. Finite, and valid."""

    side: Literal["high", "low", "alternate"] = "high"
    """Which of them; "alternate": one message high, the next low."""

    def told(self, state: State, since: float, before: Before, draw: Callable[[str], Stream]) -> State:
        high = state.seq % 2 == 0 if self.side == "alternate" else self.side == "high"
        return replace(state, **{name: _BOUNDS[name][high] for name in self.of})


AnyLie = Offset | Scale | Freeze | Replay | Random | Extreme  # Every lie a scenario may name


def lie_in_words(lie: Lie) -> str:
    """Return a lie in words.

    Examples
    --------
    >>> lie_in_words(Offset(P_set_W=1e5)), lie_in_words(Replay(delay_s=2.0, of=("Q",), in_name_of="inv5"))
    ('offset, P_set_W 100000', 'replay, of Q, delay_s 2, in the name of inv5')
    """
    parts = [str(type(lie).__struct_config__.tag)]
    for field in msgspec.structs.fields(type(lie)):
        value: Any = getattr(lie, field.name)
        if field.name in ("in_name_of", "plant") or value == field.default:
            continue
        shown = (
            f"{value:g}" if isinstance(value, float) else " ".join(value) if isinstance(value, tuple) else str(value)
        )
        parts.append(field.name.replace("_", "-") if value is True else f"{field.name} {shown}")
    if lie.in_name_of:
        parts.append(f"in the name of {lie.in_name_of}")
    if lie.plant:
        parts.append("to the plant too")
    return ", ".join(parts)


def _with(state: State, values: dict[Quantity, float]) -> State:
    """Return a state with other values, each held within the bounds of its field."""
    held: dict[str, float] = {}
    for name, value in values.items():
        low, high = _BOUNDS[name]
        held[name] = min(max(value, low), high)
    return replace(state, **held)


def _from(state: State, earlier: State, of: tuple[Quantity, ...]) -> State:
    """Return a state with values of an earlier one; what its law shares belongs to P_set."""
    values: dict[str, Any] = {name: getattr(earlier, name) for name in of}
    return replace(state, **values, **({"shared": earlier.shared} if "P_set" in of else {}))


def _no_lie(nothing: bool, keys: str) -> list[Problem]:
    return [Problem("", f"changes nothing; give {keys}")] if nothing else []
