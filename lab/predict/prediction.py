"""Predictions by theory for the cases of a scenario (docs/understand/findings.md), as numbers, tables and text."""

from __future__ import annotations

import math
import textwrap
from dataclasses import asdict
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from gridpeers.agents.carriers.law_check import PAPER
from gridpeers.lab.predict.closed_form import (
    SETTLING,
    DelayKind,
    delay_limit_closed,
    equivalent_delay,
    groups,
    modes,
    robustness,
    settling,
    settling_in_ticks,
)
from gridpeers.lab.predict.droop_runs import (
    IslandStep,
    VarResponse,
    load_steps,
    var_delay_limit,
    var_response,
    var_spectral_radius,
)
from gridpeers.lab.predict.inverter_group import InverterGroup, inverter_group_of, response_of
from gridpeers.lab.predict.linear_model import Loop, delay_limit
from gridpeers.lab.predict.times import Times, predicted_times
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Tables
from gridpeers.runs.choices import with_cases
from gridpeers.scenario import Scenario, as_scenario
from gridpeers.scenarios.run_request import BrokenRunError
from gridpeers.scenarios.schema import ScenarioError, ScenarioModel
from gridpeers.scenarios.schema.participants import inverters_of, is_calm, netem_of
from gridpeers.scenarios.schema.plugin_keys import law_of

LIMITS: dict[DelayKind, str] = {
    "neighbours": "agent to agent",
    "disagreement": "agent to agent, own value as late",
    "local loop": "plant to agent or back",
}

WIDTH = 100


def predict(scenario: Scenario | str | Path, case: str, *, voltage: bool = True) -> Prediction:
    """Predict a case of the paper's law by theory, without a run; `voltage` adds the modes of vars to its text.

    Raise ScenarioError for an unknown case, another law than "consensus", or an inverter model without a linear
    response; BrokenRunError if the plant has no solution on droop alone.
    """
    known = as_scenario(scenario)
    return predictions(with_cases(known.spec, [case]), known.feeder, voltage=voltage)[case]


def predictions(spec: ScenarioModel, feeder: Tables, *, voltage: bool) -> dict[str, Prediction]:
    others = {case: law.name for case in spec.cases if (law := law_of(spec, case)).name != PAPER}
    if others:
        raise ScenarioError(
            f'case {case}: runs the law {name}; only the law "{PAPER}" can be predicted; run the case instead'
            for case, name in others.items()
        )
    for row in inverters_of(spec, feeder):
        try:
            response_of(feeder.parameters_of(row, spec.plant.gfm, spec.plant.gfl))
        except ValueError as error:
            raise ScenarioError([f"{row.name}: {error}"]) from None
    try:
        steps, plant = load_steps(spec, feeder), var_response(spec, feeder) if voltage else None
    except PlantError as error:
        raise BrokenRunError(f"{spec.name}: on droop alone: {error}") from error
    found = {}
    for name, rule in spec.cases.items():
        title = f"{spec.name}, case {name}" + (f" {rule.title}" if rule.title else "")
        if not is_calm(netem_of(spec, name)):
            title += "; its faults of links and nodes are left out"
        islands = tuple(
            (step, inverter_group_of(spec, feeder, name, roster=step.roster, island=step.members)) for step in steps
        )
        found[name] = Prediction(title, inverter_group_of(spec, feeder, name), islands, plant)
    return found


class Prediction:
    """The prediction of theory for one case; `gridpeers.predict` returns it, and `print` shows it as text."""

    def __init__(
        self,
        title: str,
        inverters: InverterGroup,
        islands: tuple[tuple[IslandStep, InverterGroup], ...],
        plant: VarResponse | None,
    ) -> None:
        self.title = title
        self._inverters, self._islands, self._plant = inverters, islands, plant

    @property
    def _has_law(self) -> bool:
        return bool(self._inverters.acts.any())

    @cached_property
    def modes(self) -> pd.Series:
        """Rates of the slow modes (1/s) and their causes: `links`, `lambda_2`, `kappa`, `sharing_rate`, ...

        It is empty without secondary control.
        """
        found = asdict(modes(self._inverters)) if self._has_law else {}
        return pd.Series(found, name=self.title, dtype=float)

    @cached_property
    def delay_limits(self) -> pd.DataFrame:
        """Longest delays (s) for which the case is stable, of the continuous equations and of the law in its steps.

        Infinite: stable for any delay; nan: unstable without delay.
        """
        pairs = {
            name: (delay_limit_closed(self._inverters, kind), delay_limit(self._inverters, kind))
            for kind, name in LIMITS.items()
            if self._has_law
        }
        frame = pd.DataFrame.from_dict(pairs, orient="index", columns=["continuous", "discrete"], dtype=float)
        frame.attrs["units"] = {"continuous": "s", "discrete": "s"}
        return frame.rename_axis("delay")

    @cached_property
    def times(self) -> pd.DataFrame:
        """Times (s) from each event until frequency and sharing are restored: a row per (window, island).

        Columns: `restore_s` (abs(f - f_nom) < 0.01 Hz for good), `share_s` (MPSI < 0.01 for good), `t_restore_s`
        (both), nan if never; `stable`; `note`.
        """
        numbers = ["restore_s", "share_s", "t_restore_s"]
        rows = [
            (step.label, ", ".join(step.members), it.restore_s, it.share_s, it.report_s, it.stable, it.note)
            for step, _, it in self._times
        ]
        frame = pd.DataFrame(rows, columns=["window", "island", *numbers, "stable", "note"])
        frame = frame.set_index(["window", "island"]).astype(dict.fromkeys(numbers, float))
        frame.attrs["units"] = dict.fromkeys(numbers, "s")
        return frame

    @cached_property
    def _times(self) -> list[tuple[IslandStep, InverterGroup, Times]]:
        found = []
        for step, island in self._islands:
            if step.load is None:
                note = "not predicted, because islands join"
            elif not island.GFM.any():
                note = "no grid-forming inverter, so the island is de-energised"
            elif not self._has_law:
                note = "there is no secondary law"
            else:
                found.append((step, island, predicted_times(island, load=step.load)))
                continue
            found.append((step, island, Times(restore_s=None, share_s=None, stable=False, note=note)))
        return found

    def __str__(self) -> str:
        if not self._has_law:
            words = (
                "No secondary control, so there are no modes and no limits of delay. `gridpeers run` shows the droop."
            )
            return "\n".join([self.title, *_wrapped(words)])
        lines = [self.title, *_wrapped(_words(self._inverters))]
        for name, left, right, words in (("", "continuous", "our law", ""), *self._rows()):
            lines.append(f"  {name:15}{left:>12}{right:>12}   {words}".rstrip())
        for step, island, times in self._times:
            lines += _wrapped(f"{_event(step)}: {_sentence(step, island, times)}")
        return "\n".join([*lines, *_wrapped(f"Voltage and vars: {_vars(self._inverters, self._plant)}.")])

    def __repr__(self) -> str:
        return f"<Prediction {self.title}>"

    def _rows(self) -> list[tuple[str, str, str, str]]:
        inverters, found = self._inverters, modes(self._inverters)
        loop, T_c = Loop(inverters=inverters), inverters.T_c
        slowest = settling_in_ticks(loop.spectral_radius, T_c) if loop.stable else math.inf
        settled = _s(settling(found.slowest_rate), "never")
        limits = [(_s(one, "any"), _limit(other)) for one, other in self.delay_limits.itertuples(index=False)]
        r = robustness(inverters.A[np.ix_(inverters.acts, inverters.acts)])
        return [
            ("links", f"{found.links}", "", "undirected, among the inverters that run the law"),
            ("lambda_2", f"{found.lambda_2:.3f}", "", "algebraic connectivity; 0 for an unconnected graph"),
            ("lambda_max", f"{found.lambda_max:.3f}", "", "largest eigenvalue of the Laplacian"),
            ("robustness", str(r), "", f"of the graph; W-MSR resists {r.F} liars around each agent"),
            ("frequency mode", f"{found.frequency_rate:.2f} 1/s", "", "kappa n_L/N: rate if sharing were immediate"),
            ("sharing mode", _rate(found.sharing_rate), "", "kappa lambda_2: rate at which powers agree"),
            ("slowest mode", _rate(found.slowest_rate), _rate(SETTLING / slowest), "exact, of law and plant together"),
            ("2 % settling", settled, _s(slowest, "never"), "four time constants of the slowest mode"),
            ("sharing 2 %", _s(settling(found.sharing_rate), "never"), "", "four time constants of the sharing mode"),
            ("largest step", _s(found.euler_step_s, "any"), "any", "longest T_c; continuous: by explicit Euler"),
            ("delay: links", *limits[0], "from agent to agent; the own value is fresh"),
            ("delay: both", *limits[1], "the own value is as late as the neighbours'"),
            ("delay: plant", *limits[2], "measured f or P_set is late"),
            ("loss 50 %", "", _s(equivalent_delay(T_c, 0.5), ""), "equivalent delay on the links, T_c p/(1 - p)"),
            ("loss 90 %", "", _s(equivalent_delay(T_c, 0.9), ""), "the same"),
        ]


# -------------------------------------------------------------------- text


def _words(inverters: InverterGroup) -> str:
    apart = groups(inverters)
    leaders = [name for name, leads in zip(inverters.names, inverters.leads, strict=True) if leads]
    acting = int(inverters.acts.sum())
    text = f"{acting} of {inverters.n} inverters run the law; leaders {', '.join(leaders) or 'none'}; "
    text += f"kappa {inverters.kappa[inverters.acts].mean():.3g} 1/s; T_c {inverters.T_c:g} s. "
    if not leaders:
        text += "Without a leader, no agent corrects the frequency. "
    if len(apart) > 1:
        text += f"The graph is not connected; its {len(apart)} parts ({' | '.join(' '.join(part) for part in apart)}) "
        text += "share power only within themselves. "
    if idle := int((inverters.shares & ~inverters.acts).sum()):
        text += f"The other {idle} with an agent keep their set-points and do not take part in sharing. "
    if agentless := [name for name, shares in zip(inverters.names, inverters.shares, strict=True) if not shares]:
        text += f"{', '.join(agentless)} without an agent: on droop, and not counted in the sharing index. "
    return text.rstrip()


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
        text = f"frequency restored in {times.restore_s:.2f} s, power never shared equally: {times.note}"
    else:
        text = f"not restored: {times.note}"
    return f"load {step.load.start_pu:.3f} -> {step.load.load_pu:.3f} pu of the ratings: {text}"


def _vars(inverters: InverterGroup, plant: VarResponse | None) -> str:
    if plant is None:
        return "left out (--no-vars)"
    if not all(name in plant.names for name in inverters.names):
        return "not predicted with spare inverters"
    radius, limit = var_spectral_radius(inverters, plant), var_delay_limit(inverters, plant)
    if radius >= 1.0:
        return f"unstable for a plant without lags, spectral radius {radius:.4f}"
    delays = "with any delay up to 1 s" if math.isinf(limit) else f"up to {_limit(limit)} of delay"
    return (
        f"slowest mode settles to 2 % in {settling_in_ticks(radius, inverters.T_c):.2f} s; stable {delays} of "
        "measurement or set-point (for a plant without lags; accurate to about one control period)"
    )


def _rate(rate: float) -> str:
    return "none" if math.isinf(rate) else f"{rate:.2f} 1/s"


def _s(seconds: float, without: str) -> str:
    return without if math.isinf(seconds) else f"{seconds * 1e3:.1f} ms" if seconds < 0.0995 else f"{seconds:.2f} s"


def _limit(seconds: float) -> str:
    return "unstable" if math.isnan(seconds) else _s(seconds, "any")


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="  ", subsequent_indent="    ")
