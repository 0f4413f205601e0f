"""Agents that lie: frequency, sharing and limits under every attack, on every graph, with every defence."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from gridpeers.papers.singhal2022.experiments.experiment_data import SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, PlotPage, PlotPanel

EVENT = "event2"  # The event at which the lies begin

GRAPHS = ("full", "robust", "reduced")

MEASURES: tuple[tuple[str, str, float, tuple[float, float], float], ...] = (
    ("f_off_Hz", "largest abs(f - 60) at the end (Hz)", 0.01, (1e-4, 2.0), 1e-4),
    ("MPSI", "MPSI", 0.01, (1e-4, 1.0), 1e-4),
    ("MQSI", "MQSI", 0.2, (1e-3, 20.0), 1e-3),
    ("S_max_pu", "largest S at the end (pu)", 1.2, (0.4, 1.4), 0.0),
)
"""Measures, labels, the limit of the checks, ends of the axis, and the least value that is drawn."""

LIMITS = {index: limit for index, _, limit, _, _ in MEASURES}

RUN = ("case", "node", "link", "law")  # Columns that name a run


def hostile(sweep: SweepData) -> ExperimentResult:
    """Return the effect of every attack against every defence, on every graph."""
    lies = replace(sweep, window=EVENT)
    rows = lies.rows
    attacks = {attack_words(*entries): entries for entries in zip(rows["node"], rows["link"], strict=True)}
    defences = {defence_words(law): law for law in rows["law"]}
    columns = {index: lies.measured(index, rows) for index in (*LIMITS, "V_min_pu", "V_max_pu")}
    found = {
        run: {index: float(values[number]) for index, values in columns.items()}
        for number, run in enumerate(zip(*(rows[name] for name in RUN), strict=True))
    }

    def measured(case: str, attack: str, defence: str) -> Mapping[str, float]:
        return found[case, *attacks[attack], defences[defence]]

    def curves(case: str, index: str, least: float) -> list[Curve]:
        curves = []
        for style, defence in enumerate(defences):
            x = np.arange(float(len(attacks))) + 0.13 * (style - 0.5 * (len(defences) - 1))
            y = np.array([measured(case, attack, defence)[index] for attack in attacks])
            curves.append(Curve(x, np.maximum(y, least), style, "points"))
        return curves

    panels = [
        PlotPanel(
            title=sweep.base.cases[case].title if index == MEASURES[0][0] else "",
            x_label="",
            y_label=label if case == GRAPHS[0] else "",
            curves=curves(case, index, least),
            level=limit,
            log="y" if least else "",
            x_names=list(attacks) if index == MEASURES[-1][0] else [""] * len(attacks),
            y_range=ends,
        )
        for (index, label, limit, ends, least), case in product(MEASURES, GRAPHS)
    ]
    page = PlotPage(
        title="Agents lie from 4 s, when a third of the load is lost; lines: limits of the checks",
        panels=panels,
        columns=len(GRAPHS),
        names=dict(enumerate(defences)),
        looks={},
        share_y=True,
        height=3.0,
    )
    table = [
        {"graph": case, "numbers": what, "attack": attack}
        | {defence: cell(measured(case, attack, defence)) for defence in defences}
        for case, (what, cell), attack in product(GRAPHS, CELLS.items(), attacks)
    ]
    return ExperimentResult(page, table, apart=2)


def frequency_cell(found: Mapping[str, float]) -> str:
    """Return the frequency error (Hz), bold out of its limit, with a letter for everything else that is out of its own.

    >>> frequency_cell({"f_off_Hz": 0.034, "MPSI": 0.02, "MQSI": 0.1, "S_max_pu": 0.56})
    '**0.034** P'
    >>> frequency_cell({"f_off_Hz": 0.004, "MPSI": 0.0, "MQSI": 0.3, "S_max_pu": 1.3})
    '0.004 Q S'
    """
    letters = {"MPSI": "P", "MQSI": "Q", "S_max_pu": "S"}
    out = [letter for index, letter in letters.items() if found[index] > LIMITS[index]]
    return " ".join([_bold_if_out(found, "f_off_Hz", ".3f"), *out])


def _bold_if_out(found: Mapping[str, float], index: str, form: str = ".2f") -> str:
    text = f"{found[index]:{form}}"
    return f"**{text}**" if found[index] > LIMITS[index] else text


CELLS: Mapping[str, Callable[[Mapping[str, float]], str]] = {
    "frequency error (Hz)": frequency_cell,
    "MPSI / MQSI": lambda found: f"{_bold_if_out(found, 'MPSI')} / {_bold_if_out(found, 'MQSI')}",
    "S / V (pu)": lambda found: f"{_bold_if_out(found, 'S_max_pu')} / {found['V_min_pu']:.2f}..{found['V_max_pu']:.2f}",
}
"""The tables of a graph: their numbers, and a cell of them from what was measured."""


def attack_words(node: str, link: str) -> str:
    """Return an attack in words, from the entries of its nodes and links as the sweep writes them.

    >>> attack_words("[]", "[]"), attack_words("[]", '[{"on": "* -> inv1", "loss": 0.9}]')
    ('nobody lies', 'flood, 90 % lost')
    >>> lies = {"model": "offset", "P_set_W": 1e5, "plant": True, "in_name_of": "inv1"}
    >>> attack_words(json.dumps([{"name": "inv2", "lies": lies}]), "[]")
    'offset 100 kW, as inv1, plant too'
    >>> attack_words(json.dumps([{"name": name, "lies": {"model": "freeze"}} for name in ("inv2", "inv5")]), "[]")
    'freeze, two'
    """
    liars, links = json.loads(node), json.loads(link)
    if links:
        lost = links[0].get("loss")
        return "old bytes, all twice" if lost is None else f"flood, {100.0 * lost:g} % lost"
    return ", ".join(_lie_words(liars)) if liars else "nobody lies"


SIZES = (("P_set_W", 1e-3, " kW"), ("P_set", 1.0, ""), ("delay_s", 1.0, " s"))
"""Keys of a lie that are its size: key, factor, and unit in words."""


def _lie_words(liars: list[dict[str, Any]]) -> Iterator[str]:
    lies = liars[0]["lies"]
    yield lies["model"] + "".join(f" {factor * lies[key]:g}{unit}" for key, factor, unit in SIZES if key in lies)
    if "side" in lies:
        yield str(lies["side"])
    if lies.get("two_faced"):
        yield "two-faced"
    if "in_name_of" in lies:
        yield f"as {lies['in_name_of']}"
    elif lies.get("plant"):
        yield "leader"
    if lies.get("plant"):
        yield "plant too"
    if len(liars) > 1:
        yield {2: "two"}.get(len(liars), str(len(liars)))


def defence_words(law: str) -> str:
    """Return a defence in words, from the law as the sweep writes it.

    >>> defence_words('"consensus"'), defence_words('{"use": "resilient", "F": 1, "tolerance": 0.1, "T_out": 0.5}')
    ("the paper's law", 'F = 1, plausible')
    """
    given = json.loads(law)
    if isinstance(given, str):
        return "the paper's law"
    words = [f"F = {given['F']}"] if given["F"] else []
    words += ["plausible"] if given.get("tolerance") else []
    words += ["rate"] if given.get("rate") else []
    return ", ".join(words)
