"""What a scenario says to have an action of a page happen in each of its runs, at a time of its own."""

from __future__ import annotations

from typing import Any

from gridpeers.scenarios.schema.scenario_writing import inline
from gridpeers.viewer.page_actions import PageAction


def scenario_form(action: PageAction) -> str:
    """Return the lines of an entry of a scenario file, without its time; empty if an action ends another entry.

    An entry `[[event]]` needs a label and t_s beside, and `[[link]]` takes from_s and to_s; to heal a link is to_s of
    the entry that cuts it.

    Examples
    --------
    >>> print(scenario_form(PageAction(kind="load", subject="48", factor=1.5)))
    [[event]]
    load = { 48 = { factor = 1.5 } }
    >>> print(scenario_form(PageAction(kind="loss", subject="inv1", other="inv4", value=0.25)))
    [[link]]
    on = "inv1 <-> inv4"
    loss = 0.25
    """
    link: dict[str, Any] = {"on": f"{action.subject} <-> {action.other}"}
    match action.kind:
        case "open":
            return _entry("event", {"open": [action.subject]})
        case "close":
            return _entry("event", {"close": [action.subject]})
        case "synchronise":
            return _entry("event", {"close": [action.subject], "synchronised": True})
        case "stop":
            return _entry("event", {"leave": [action.subject]})
        case "start":
            return _entry("event", {"join": [action.subject]})
        case "load":
            given = {"factor": action.factor, "P_kW": action.P_kW, "Q_kvar": action.Q_kvar}
            power = {key: value for key, value in given.items() if value is not None}
            return _entry("event", {"load": {action.subject: power}})
        case "cut":
            return _entry("link", link | {"cut": True})
        case "delay" | "loss":
            return _entry("link", link | {action.kind: action.value})
    return ""


def _entry(table: str, keys: dict[str, Any]) -> str:
    return "\n".join([f"[[{table}]]", *(f"{key} = {inline(value)}" for key, value in keys.items())])
