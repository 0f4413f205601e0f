"""Calls of a law: whatever it raises or returns, the agent gets set-points or one clear sentence. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from agents.laws.law import Law, Neighbour, Own, SetPoints
from wire.bounds import MOST_SHARED, SHARED_LIMIT
from wire.printable import printable

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,31}")


class LawError(RuntimeError):
    """A law that raised, took too long, or returned what is no decision."""


def begun(law: Law, own: Own) -> None:
    """Have a law begin from the set-points that the plant holds.

    Raises
    ------
    LawError
        If it fails.
    """
    try:
        law.start(own)
    except LawError:
        raise
    except Exception as error:  # a law is anybody's code
        raise LawError(f"start at t = {own.t:.6g} s raised {_named(error)}") from error


def decided(law: Law, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
    """Return what a law decides, within its limits.

    Raises
    ------
    LawError
        If it fails, or what it returns is none.

    Examples
    --------
    >>> class Far(Law):
    ...     def step(self, own, neighbours, T):
    ...         return SetPoints(7.0, 1.0)
    >>> own = Own("inv1", True, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.01, 0.05, 6e5, 277.0, 60.0)
    >>> decided(Far(), own, (), 0.02).P_set
    1.0
    """
    try:
        result = law.step(own, neighbours, T)
    except LawError:
        raise
    except Exception as error:  # a law is anybody's code
        raise LawError(f"step at t = {own.t:.6g} s raised {_named(error)}") from error
    if not isinstance(result, SetPoints):
        raise LawError(f"step at t = {own.t:.6g} s returned {_shown(result)}; return SetPoints(P_set=..., V_set=...)")
    P_set, V_set = (_number(name, getattr(result, name), own.t) for name in ("P_set", "V_set"))
    return SetPoints(
        P_set=min(max(P_set, law.P_set_min), law.P_set_max),
        V_set=min(max(V_set, law.V_set_min), law.V_set_max),
        shared=_checked(result.shared, own.t) if result.shared else result.shared,
        send=bool(result.send),
    )


def _number(name: str, value: Any, t: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        try:
            value = float(value)  # a number of numpy's
        except (TypeError, ValueError):
            raise LawError(f"step at t = {t:.6g} s returned {name} = {_shown(value)}; it must be a number") from None
        if not isfinite(value):
            raise LawError(f"step at t = {t:.6g} s returned {name} = {value}; it must be a finite number (pu)")
    return float(value)


def _checked(shared: Any, t: float) -> Mapping[str, float]:
    """Return what a law shares, if it may."""
    if not isinstance(shared, Mapping) or len(shared) > MOST_SHARED:
        raise LawError(f"step at t = {t:.6g} s shares {_shown(shared)}; share at most {MOST_SHARED} numbers by name")
    found = {}
    for name, value in shared.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise LawError(f"step at t = {t:.6g} s shares {_shown(name)}; a name has up to 32 letters, digits and _")
        found[name] = _number(f'shared["{name}"]', value, t)
        if abs(found[name]) > SHARED_LIMIT:
            raise LawError(f"step at t = {t:.6g} s shares {name} = {value:g}; at most {SHARED_LIMIT:g} may travel")
    return found


def _named(error: Exception) -> str:
    return printable(f"{type(error).__name__}: {error}", 200)


def _shown(value: Any) -> str:
    return printable(repr(value), 100)
