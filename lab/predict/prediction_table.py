"""Predictions of a case as text for people, within 100 columns: each number with its unit and its meaning."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np

from gridpeers.lab.predict.case_prediction import CasePrediction
from gridpeers.lab.predict.closed_form import SETTLING, DelayKind, equivalent_delay, groups, settling_in_ticks
from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.lab.predict.linear_model import Loop
from gridpeers.lab.predict.load_steps import IslandStep
from gridpeers.lab.predict.robustness import robustness
from gridpeers.lab.predict.times import Times
from gridpeers.lab.predict.var_response import var_delay_limit, var_spectral_radius

WIDTH = 100
"""Columns."""

TextRow = tuple[str, str, str, str]
"""Quantity, by the continuous law, by ours in discrete time, meaning."""


def case_text(case: CasePrediction) -> str:
    """Return all predictions of one case."""
    if not case.has_law:
        words = "No secondary control: no modes, no limits of delay. Droop alone decides, at once: `gridpeers run`."
        return "\n".join([case.title, *_wrapped(words, "  ")])
    lines = [case.title, *_wrapped(_words(case), "  ")]
    lines += _aligned([("", "continuous", "our law", ""), *_rows(case)])
    for (step, island), times in zip(case.islands, case.times, strict=True):
        lines += _wrapped(f"{_event(step)}: {_sentence(step, island, times)}", "  ")
    lines += _wrapped(f"Voltage and vars: {_vars(case)}.", "  ")
    return "\n".join(lines)


def _words(case: CasePrediction) -> str:
    inverters, apart = case.inverters, groups(case.inverters)
    leaders = [name for name, leads in zip(inverters.names, inverters.leads, strict=True) if leads]
    acting = int(inverters.acts.sum())
    text = f"{acting} of {inverters.n} inverters run the law; leaders {', '.join(leaders) or 'none'}; "
    text += f"kappa {case.modes.kappa:.3g} 1/s; T_c {inverters.T_c:g} s. "
    if not leaders:
        text += "Nobody leads, so nobody corrects the frequency. "
    if len(apart) > 1:
        text += f"The graph is not connected; its {len(apart)} parts ({' | '.join(' '.join(part) for part in apart)}) "
        text += "agree on power within themselves only, so sharing among all never comes. "
    if idle := int((inverters.shares & ~inverters.acts).sum()):
        text += f"The other {idle} with an agent keep their set-points and take no part in sharing. "
    if agentless := [name for name, shares in zip(inverters.names, inverters.shares, strict=True) if not shares]:
        text += f"{', '.join(agentless)} without an agent: droop alone, and the sharing index leaves them out. "
    return text.rstrip()


def _rows(case: CasePrediction) -> list[TextRow]:
    inverters, found, loop = case.inverters, case.modes, Loop(inverters=case.inverters)
    slowest = settling_in_ticks(loop.spectral_radius, inverters.T_c) if loop.stable else math.inf

    def limits(kind: DelayKind) -> tuple[str, str]:
        continuous, discrete = case.delay_limits[kind]
        return _s(continuous, "any"), _limit(discrete)

    return [
        ("links", f"{found.links}", "", "undirected, among those that run the law"),
        ("lambda_2", f"{found.lambda_2:.3f}", "", "algebraic connectivity; 0 when parts are not linked"),
        ("lambda_max", f"{found.lambda_max:.3f}", "", "largest eigenvalue of the Laplacian"),
        ("robustness", *_robustness(inverters)),
        ("frequency mode", f"{found.frequency_rate:.2f} 1/s", "", "kappa n_L/N: rate if sharing were at once"),
        ("sharing mode", _rate(found.sharing_rate), "", "kappa lambda_2: rate at which powers agree"),
        ("slowest mode", _rate(found.slowest_rate), _rate(SETTLING / slowest), "exact, of law and plant together"),
        ("2 % settling", _s(found.frequency_settling_s, "never"), _s(slowest, "never"), "four time constants of it"),
        ("sharing 2 %", _s(found.sharing_settling_s, "never"), "", "the same of the sharing mode"),
        ("largest step", _s(found.euler_step_s, "any"), "any", "longest T_c; continuous: as explicit Euler"),
        ("delay: links", *limits("neighbours"), "agent to agent, own value fresh"),
        ("delay: both", *limits("disagreement"), "own value as late as neighbours'"),
        ("delay: plant", *limits("local loop"), "f as measured, or P_set, late"),
        ("loss 50 %", "", _s(equivalent_delay(inverters.T_c, 0.5), ""), "held: as so much more delay on the links"),
        ("loss 90 %", "", _s(equivalent_delay(inverters.T_c, 0.9), ""), "the same; T_c p/(1 - p)"),
    ]


def _robustness(inverters: InverterGroup) -> tuple[str, str, str]:
    """Return the r-robustness of the graph of those that run the law, and the liars that it bears."""
    found = robustness(inverters.A[np.ix_(inverters.acts, inverters.acts)])
    return str(found), "", f"of the graph; W-MSR bears F = {found.F} liars around each agent"


def _event(step: IslandStep) -> str:
    where = "" if set(step.members) == set(step.roster) else f" ({', '.join(step.members)})"
    return f"{step.label} at {step.t_s:g} s{where}"


def _sentence(step: IslandStep, island: InverterGroup, times: Times) -> str:
    if step.load is None or not island.GFM.any():
        return times.note
    if times.report_s is not None:
        text = (
            f"restored in {times.report_s:.2f} s (abs(f - f_nom) < 0.01 Hz for good in {times.restore_s:.2f} s, "
            f"MPSI < 0.01 in {times.share_s:.2f} s)"
        )
    elif times.restore_s is not None:
        text = f"frequency back in {times.restore_s:.2f} s, equal power never: {times.note}"
    else:
        text = f"not restored: {times.note}"
    return f"load {step.load.start_pu:.3f} -> {step.load.load_pu:.3f} pu of the ratings: {text}"


def _vars(case: CasePrediction) -> str:
    inverters, plant = case.inverters, case.plant
    if plant is None:
        return "left out by --no-vars"
    if not all(name in plant.names for name in inverters.names):
        return "not predicted with spare inverters"
    radius, limit = var_spectral_radius(inverters, plant), var_delay_limit(inverters, plant)
    if radius >= 1.0:
        return f"unstable on a plant without lags, spectral radius {radius:.4f}"
    delays = "with any delay up to 1 s" if math.isinf(limit) else f"up to {_limit(limit)} of delay"
    return (
        f"slowest mode to 2 % in {settling_in_ticks(radius, inverters.T_c):.2f} s; stable {delays} of measurement or "
        "set-point (on a plant without lags; right to about one control period)"
    )


def _rate(rate: float) -> str:
    return "none" if math.isinf(rate) else f"{rate:.2f} 1/s"


def _s(seconds: float, without: str) -> str:
    return without if math.isinf(seconds) else f"{seconds * 1e3:.1f} ms" if seconds < 0.0995 else f"{seconds:.2f} s"


def _limit(seconds: float) -> str:
    return "unstable" if math.isnan(seconds) else _s(seconds, "any")


def _aligned(rows: Sequence[TextRow]) -> list[str]:
    return [f"  {name:15}{left:>12}{right:>12}   {words}".rstrip() for name, left, right, words in rows]


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "  ")
