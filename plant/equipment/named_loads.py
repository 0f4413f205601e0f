"""The loads of a feeder by name, the powers that they can be given, and the feeder with such powers. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
from msgspec.structs import replace

from gridpeers.plant.equipment import Tables
from gridpeers.wire.messages import LoadSetting
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.schema.table_schema import Plausible
from gridpeers.wire.wording import first_of, suggestion

FACTOR = Plausible("a factor on a load", 0.0, 10.0)  # factors on the power that a load has in the feeder's tables
LEAST = 0.01  # part of its branches' sizes below which a load's total does not say how they share it


class NamedLoad(msgspec.Struct, frozen=True, kw_only=True):
    """A load as people speak of it: all rows of our own tables at one bus, or all parts of one imported load."""

    name: str  # name: that of the bus, or of the imported load
    bus: str
    S: complex  # power at nominal voltage (VA), of all branches


def named_loads(feeder: Tables) -> dict[str, NamedLoad]:
    found: dict[str, NamedLoad] = {}
    for name, bus, S in (
        *((load.bus, load.bus, sum(load.S)) for load in feeder.loads),
        *((part.name, part.bus, part.S) for part in feeder.load_parts),
    ):
        first = found.get(name, NamedLoad(name=name, bus=bus, S=0j))
        found[name] = replace(first, S=first.S + S)
    return found


def load_name(loads: Mapping[str, NamedLoad], text: str) -> str:
    """Return the name of a load by its name, with or without OpenDSS's "load." before it, or by its bus.

    ValueError if there is no such load, or the text may mean several; the message says what was probably meant.
    """
    if text in loads:
        return text
    named = [name for name in loads if _bare(name) == _bare(text)]
    here = [load.name for load in loads.values() if load.bus == text]
    meant = list(dict.fromkeys([*named, *here]))
    if len(meant) == 1:
        return meant[0]
    if named and here:
        raise ValueError(f'load "{text}": it has this name, or this bus: {first_of(meant, 8)}; name one')
    if here:
        raise ValueError(f'load "{text}": bus {text} has {len(here)} loads: {first_of(here, 8)}; name one of them')
    raise ValueError(f'load "{text}": no such load; {suggestion(text, loads, "loads")}')


def _bare(name: str) -> str:
    return name[5:] if name[:5].lower() == "load." else name


def with_powers(feeder: Tables, powers: Mapping[str, complex]) -> Tables:
    """Return a feeder in which some loads have another power at nominal voltage (VA), by name.

    Branches keep their shares of the real and of the reactive power; a power that was none is shared by their sizes.
    """
    of_bus: dict[str, list[complex]] = {}
    of_part: dict[str, list[complex]] = {}
    for load in feeder.loads:
        of_bus.setdefault(load.bus, []).extend(load.S)
    for part in feeder.load_parts:
        of_part.setdefault(part.name, []).append(part.S)
    bus = {name: iter(_shared(of_bus[name], S)) for name, S in powers.items() if name in of_bus}
    of = {name: iter(_shared(of_part[name], S)) for name, S in powers.items() if name in of_part}
    return replace(
        feeder,
        loads=tuple(
            replace(load, S=(next(bus[load.bus]), next(bus[load.bus]), next(bus[load.bus])))
            if load.bus in bus
            else load
            for load in feeder.loads
        ),
        load_parts=tuple(
            replace(part, S=next(of[part.name])) if part.name in of else part for part in feeder.load_parts
        ),
    )


def _shared(branches: Sequence[complex], total: complex) -> list[complex]:
    P = _scaled([S.real for S in branches], [abs(S) for S in branches], total.real)
    Q = _scaled([S.imag for S in branches], [abs(S) for S in branches], total.imag)
    return [complex(p, q) for p, q in zip(P, Q, strict=True)]


def _scaled(values: Sequence[float], sizes: Sequence[float], total: float) -> list[float]:
    before = plain_sum(values)
    if abs(before) > LEAST * sum(map(abs, values)):
        return [value * (total / before) for value in values]
    whole = plain_sum(sizes)
    return [
        value + (total - before) * size / whole if whole else value for value, size in zip(values, sizes, strict=True)
    ]


MOST = 10.0  # greatest power of one load, over that of all loads, or of the inverters' ratings if more


class LoadPowers:
    """The loads of a feeder by name, and the powers that each can have; `P_rated`: of all inverters (W)."""

    def __init__(self, feeder: Tables, P_rated: float) -> None:
        self._loads = named_loads(feeder)
        self._most = MOST * max(sum(abs(load.S) for load in self._loads.values()), P_rated) / 1e3

    def name(self, text: str) -> str:
        return load_name(self._loads, text)

    def table(self, name: str) -> complex:
        return self._loads[name].S

    def power(self, name: str, setting: LoadSetting, now: Mapping[str, complex]) -> complex:
        """Return the power (VA) of a load after a setting; ValueError says what would be right.

        `now`: present powers of loads that have other ones than in the tables.
        """
        table, most = self._loads[name].S, self._most
        before = now.get(name, table)
        if (setting.factor is None) == (setting.P is None and setting.Q is None):
            raise ValueError("takes either a factor, or real or reactive power")
        if setting.factor is not None:
            S, text = setting.factor * table, FACTOR.objection(setting.factor)
        else:
            P = before.real if setting.P is None else setting.P
            Q = before.imag if setting.Q is None else setting.Q
            real = Plausible("the real power of a load", 0.0 if table.real >= 0.0 else -most, most)
            reactive = Plausible("the reactive power of a load", -most, most)
            S, text = complex(P, Q), real.objection(P / 1e3, "kW") or reactive.objection(Q / 1e3, "kvar")
        if text:
            raise ValueError(text)
        return S

    def words(self, name: str, S: complex) -> str:
        return f"{S.real / 1e3:.6g} kW and {S.imag / 1e3:.6g} kvar at nominal voltage{_beside(S, self.table(name))}"


def _beside(S: complex, table: complex) -> str:
    """Return how a power is beside that of the tables, "" if that is no factor."""
    if not table:
        return ""
    factor = (S / table).real
    if abs(S - factor * table) > 1e-9 * abs(table):
        return ""
    return ", as in its table" if factor == 1.0 else f", {factor:.4g} times its table"
