"""Trip settings of a scenario: their mistakes."""

from __future__ import annotations

from plant.trip_settings import DEFAULTS, defaults
from scenarios.spec.scenario_errors import Mistakes
from scenarios.spec.scenario_model import Scenario
from wire.suggestion import suggestion

PATH = "protection.trips"

LONGEST = 3600.0
"""Longest clearing time (s)."""


def check_protection(scenario: Scenario, f_nom: float, mistakes: Mistakes) -> None:
    """Settings are of functions that there are, on the right side of nominal, each second stage beyond its first."""
    given = scenario.protection.trips
    if mistakes.touch("protection", PATH):
        return
    names = DEFAULTS["III"]
    for name, (threshold, time) in given.items():
        if name not in names:
            mistakes.add(PATH, f'no trip function "{name}"; {suggestion(name, names, "functions")}')
            continue
        nominal, unit = (f_nom, "Hz") if name[1] == "F" else (1.0, "pu")
        low, high = (nominal, 2.0 * nominal) if name[0] == "O" else (0.0, nominal)
        if not low < threshold < high:
            mistakes.add(PATH, f"{name} must be between {low:g} and {high:g} {unit}, got {threshold:g} {unit}")
        if not 0.0 < time <= LONGEST:
            mistakes.add(PATH, f"{name}: the clearing time must be above 0 and at most {LONGEST:g} s, got {time:g} s")
    if mistakes.touch(PATH) or scenario.protection.category == "off":
        return
    in_force = defaults(scenario.protection.category, f_nom) | given
    for kind in ("OV", "UV", "OF", "UF"):
        (first, _), (second, _) = in_force[f"{kind}1"], in_force[f"{kind}2"]
        if second < first if kind[0] == "O" else second > first:
            unit = "Hz" if kind[1] == "F" else "pu"
            mistakes.add(
                PATH,
                f"{kind}2 = {second:g} {unit} must be farther from nominal than {kind}1 = {first:g} {unit}; "
                f"set both, or leave {kind}2 as it is",
            )
