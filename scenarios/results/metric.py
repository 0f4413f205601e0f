"""Metrics: functions of an event's window, their registry, and the reasons of those that fail.

    @gridpeers.metric("nadir_Hz")
    def nadir(window):
        '''Lowest frequency of a grid-forming inverter (Hz).'''
        return window.f[:, window.nameplates.GFM].min()

A metric returns a number, or several by name. A name ends in the unit, as a key does. A class with parameters
(annotated attributes, `docs/how-to/plug-ins.md`) and a method `__call__(self, window)` is a metric too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

from gridpeers.wire.plugins.plugin import KEYS, Plugin, callable_objection, made
from gridpeers.wire.plugins.registry import ANYTHING, PluginError, Registry, named
from gridpeers.wire.wording import printable

if TYPE_CHECKING:
    from gridpeers.scenarios.results.window_metrics import WindowData


Quantity = Literal["f_error_Hz", "MPSI", "V_error", "MQSI"]  # A column of the tables, named as in metrics.json
Measure = Quantity | Literal["p"]  # A steady value: a quantity of the tables, or the powers of the inverters

UNITS: dict[str, str] = {"f_error_Hz": " Hz", "MPSI": "", "V_error": " pu", "MQSI": "", "p": " pu"}
"""Unit as it follows a number."""

DIGITS: dict[Measure, int] = {"f_error_Hz": 2, "MPSI": 2, "V_error": 3, "MQSI": 2, "p": 2}
"""Decimals that make sense, and that the paper prints: smaller differences vary from run to run of a microgrid."""


_ENDINGS = ("s", "Hz", "pu", "kW", "kvar", "W", "var", "V")


def unit_of(name: str) -> str:
    """Return the unit of a column, with which the name of a key or an index ends."""
    *above, last = name.split(".")
    if last == "V_error" or above[-1:] == ["p"]:
        return "pu"
    rest, _, unit = last.rpartition("_")
    return unit if rest and unit in _ENDINGS else ""


def label(measure: str, f_nom: float = 60.0) -> str:
    """Return the name of a measure for people, such as "abs(f-50)", at a nominal frequency (Hz)."""
    return {"f_error_Hz": f"abs(f-{f_nom:g})", "p": "P"}.get(measure, measure)


def heading(quantity: Quantity, f_nom: float = 60.0) -> str:
    """Return the heading of a column, such as "abs(f-50) Hz", at a nominal frequency (Hz)."""
    return f"{label(quantity, f_nom)}{UNITS[quantity]}"


HEADINGS: dict[Quantity, str] = {quantity: heading(quantity) for quantity in get_args(Quantity)}
"""Headings of the columns at the paper's nominal frequency, 60 Hz."""

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,40}")

ALWAYS = ("f_error_Hz", "MPSI", "V_error", "MQSI", "t_restore_s", "t_load_s", "p", "messages_saved")
"""Metrics of gridpeers that every run has."""

_OURS = (*ALWAYS, "t_f_s", "t_share_s", "f_swing_Hz", "V_swing_pu", "f_off_Hz", "S_max_pu", "V_min_pu", "V_max_pu")


METRICS: Registry[Any] = Registry(
    "metric",
    "metrics",
    lambda it: callable_objection(it, "window", (*KEYS, "name")),
    own={name: f"gridpeers.scenarios.results.window_metrics:{name}" for name in _OURS},
)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Values of the metrics of a scenario in one window."""

    values: Mapping[str, float | None] = field(default_factory=dict)
    """None where there is no value."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Reasons of the metrics that lack a value."""


def name_of(plugin: Plugin, label: str = "") -> str:
    """Return the name of a metric in tables: its label, or the last part of its reference."""
    return label or plugin.use.rpartition(":")[2].rpartition(".")[2]


def good_name(name: str) -> bool:
    return bool(_NAME.fullmatch(name))


def measured(metrics: Sequence[tuple[str, Callable[[WindowData], Any]]], data: WindowData) -> Measured:
    """Return the values of some metrics, each of which may fail without harm to the others."""
    values: dict[str, float | None] = {}
    reasons: dict[str, str] = {}
    for name, metric in metrics:
        try:
            result = metric(data)
            several = dict(result) if isinstance(result, Mapping) else {"": result}
            numbers = {printable(str(key), 60): _number(value) for key, value in several.items()}
        except ANYTHING as error:  # a metric is a user's code, and its result is too
            said = printable(str(error), 160) if isinstance(error, PluginError) else named(error)
            values[name], reasons[name] = None, f"failed: {said}{_columns(error, data)}"
            continue
        finally:
            vars(data).pop("history", None)  # the next metric has a table that this one has not changed
        for key, (value, reason) in numbers.items():
            full = f"{name}.{key}" if key else name
            values[full], reasons[full] = value, reason
    return Measured(values=values, reasons={name: text for name, text in reasons.items() if text})


def metric_of(plugin: Plugin) -> Callable[[WindowData], Any]:
    """Return a metric; one that cannot be made fails in every window."""
    try:
        metric: Callable[[WindowData], Any] = made(METRICS, plugin)
        return metric
    except ValueError as error:
        kept = error

        def fail(data: WindowData) -> Any:
            raise kept

        return fail


def _number(value: Any) -> tuple[float | None, str]:
    """Return a value as a number, or None and why; None itself stands for no value, as of a time that never came."""
    if value is None:
        return None, ""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        return None, f"returned {printable(repr(value), 80)}; return a number, or numbers by name"
    return (number, "") if math.isfinite(number) else (None, f"is no finite number: {number}")


def _columns(error: BaseException, data: WindowData) -> str:
    if not isinstance(error, (KeyError, AttributeError, IndexError)):
        return ""
    few = ", ".join(data.inverters[:12]) + (", ..." if len(data.inverters) > 12 else "")
    return f"; the inverters are {few}, their quantities f, P, Q, V, P_set, V_set"
