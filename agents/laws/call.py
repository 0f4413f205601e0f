"""Call a law: for each exception or result, the agent gets set-points or one clear sentence. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from gridpeers.agents.agent_config import SharedQuantity
from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own, SetPoints, Terms
from gridpeers.wire.messages import MOST_SHARED, SHARED_LIMIT
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.plugins.registry import ANYTHING, line_of, named
from gridpeers.wire.schema.table_schema import Range
from gridpeers.wire.wording import printable, suggestion

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,31}")

_ADDRESS = re.compile(r" at 0x[0-9a-f]+")  # Address of an object in memory, which differs in every run


class LawError(RuntimeError):
    """A law raised an exception, took too long, or returned no decision."""


def start_law(law: Law, own: Own) -> None:
    """Start a law from the set-points that the plant holds; raise LawError if it fails."""
    try:
        law.start(own)
    except LawError:
        raise
    except ANYTHING as error:
        raise LawError(f"start at t = {own.t:.6g} s raised {named(error)}") from error


def decide(law: Law, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
    """Return a law's decision, within its limits; raise LawError if it fails, or returns no decision."""
    try:
        result = law.step(own, neighbours, T)
    except LawError:
        raise
    except ANYTHING as error:
        raise LawError(f"step at t = {own.t:.6g} s raised {named(error)}") from error
    try:
        if isinstance(result, Terms):
            result = _summed(result, own)
        if not isinstance(result, SetPoints):
            text = f"step at t = {own.t:.6g} s returned {_shown(result)}; return SetPoints(P_set=..., V_set=...)"
            raise LawError(text)
        P_set, V_set, shared, send, terms = result
        if not (type(P_set) is type(V_set) is float and isfinite(P_set) and isfinite(V_set)):
            P_set, V_set = _number("P_set", P_set, own.t), _number("V_set", V_set, own.t)
        elif (
            shared is NOTHING_SHARED
            and send is True
            and law.P_set_min <= P_set <= law.P_set_max
            and law.V_set_min <= V_set <= law.V_set_max
        ):
            return result
        return SetPoints(
            min(max(P_set, law.P_set_min), law.P_set_max),
            min(max(V_set, law.V_set_min), law.V_set_max),
            NOTHING_SHARED if shared is NOTHING_SHARED else _checked(shared, own.t),
            bool(send),
            terms,
        )
    except LawError:
        raise
    except ANYTHING as error:  # the result is foreign code too: its bool(), float() or items() may raise
        raise LawError(f"step at t = {own.t:.6g} s returned {_shown(result)}, which raised {named(error)}") from error


def failed_at(law: Law, error: LawError, folder: str) -> str:
    """Return the place where a law in Python failed, as " (mine.py:12)"; empty for a program or an FMU.

    A file in the scenario's `folder` is named relative to it.
    """
    carried = getattr(law, "carried", law)
    if type(carried).__module__.startswith("gridpeers.agents.carriers."):
        return ""
    return line_of(carried.step, error, folder)


def _summed(terms: Terms, own: Own) -> SetPoints:
    P_set, V_set = (
        before + plain_sum(_number(f"term {_shown(term.name)}", term.value, own.t) for term in of)
        for before, of in ((own.P_set, terms.P_set), (own.V_set, terms.V_set))
    )
    return SetPoints(P_set, V_set, terms.shared, terms.send, lambda: terms)


def _number(name: str, value: Any, t: float) -> float:
    if isinstance(value, (str, bytes)):
        raise LawError(f"step at t = {t:.6g} s returned {name} = {_shown(value)}; it must be a number")
    try:
        number = float(value)  # a whole number, or one of numpy's
    except (TypeError, ValueError, OverflowError):
        raise LawError(f"step at t = {t:.6g} s returned {name} = {_shown(value)}; it must be a number") from None
    if not isfinite(number):
        raise LawError(f"step at t = {t:.6g} s returned {name} = {number}; it must be a finite number (pu)")
    return number


def _checked(shared: Any, t: float) -> Mapping[str, float]:
    if not isinstance(shared, Mapping) or len(shared) > MOST_SHARED:
        raise LawError(f"step at t = {t:.6g} s shares {_shown(shared)}; share at most {MOST_SHARED} numbers by name")
    checked = {}
    for name, value in shared.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise LawError(f"step at t = {t:.6g} s shares {_shown(name)}; a name has up to 32 letters, digits and _")
        checked[name] = _number(f'shared["{name}"]', value, t)
        if abs(checked[name]) > SHARED_LIMIT:
            raise LawError(f"step at t = {t:.6g} s shares {name} = {value:g}; share at most {SHARED_LIMIT:g}")
    return checked


def objection_to(shared: Mapping[str, float], declared: Mapping[str, SharedQuantity]) -> str:
    """Return the first value beyond its declared range, and the range; empty if all are within."""
    for name, value in shared.items():
        it = declared.get(name)
        if it is not None and not it.low <= value <= it.high:
            return f"{name}, which {Range(it.low, it.high).objection(value, it.unit)}"
    return ""


def misnamed(shared: Mapping[str, float], declared: Mapping[str, SharedQuantity]) -> str:
    """Return the first value that the law does not declare, with a suggestion; empty if it declares none."""
    wrong = next((name for name in shared if name not in declared), "") if declared else ""
    return wrong and f"{wrong}, which it does not declare; {suggestion(wrong, declared, 'quantities')}"


def _shown(value: Any) -> str:
    try:
        return printable(_ADDRESS.sub("", repr(value)), 100)
    except ANYTHING:
        return f"a {type(value).__name__} that cannot be shown"
