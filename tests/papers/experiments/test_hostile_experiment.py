"""The experiment `hostile`: its graphs resist the liars that r-robustness predicts, and its table has every run."""

from __future__ import annotations

import json
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd
from msgspec.structs import replace

from gridpeers.lab.predict.closed_form import robustness
from gridpeers.papers.singhal2022.experiments.experiment_data import SweepData
from gridpeers.papers.singhal2022.experiments.hostile_experiment import GRAPHS, attack_words, defence_words, hostile
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.sweep.sweep_case import run_one
from gridpeers.scenarios.sweep.sweep_reading import read_sweep
from tests.papers.experiments.experiment_runs import theory
from tests.unit.agents.test_resilient_law import spread_after

sweep = cache(partial(read_sweep, "hostile"))


def written(run: Any, *keys: str) -> list[str]:
    """Parameters of a run of the sweep as its table has them."""
    return [json.dumps(run.shown[key], default=str) for key in keys]


def graph(case: str) -> np.ndarray:
    return (theory("graphs").inverters[case].A > 0.0).astype(float)


def test_the_graphs_resist_two_liars_one_and_none() -> None:
    """R is 5, 3 and 1."""
    assert [robustness(graph(case)).least for case in GRAPHS] == [5, 3, 1]


def test_below_3_robust_one_constant_liar_keeps_the_honest_apart() -> None:
    """On the reduced graph (r 1) the range of the honest agents does not close with F = 1, even without a liar."""
    start = np.array([0.2, 0.2, 0.2, 0.5, 0.5, 0.5, 0.8, 0.8, 0.8])
    lies = np.full((400, 9, 9), 0.2)

    assert np.ptp(spread_after(graph("reduced"), start, {1}, 1, lies)[-1]) > 0.1
    assert np.ptp(spread_after(graph("reduced"), start, set(), 1, lies)[-1]) > 0.1
    assert np.ptp(spread_after(graph("robust"), start, {1}, 1, lies)[-1]) < 1e-3


def test_every_run_is_in_the_table_under_its_own_name() -> None:
    """Every attack and every defence has its own name, on every graph."""
    plan = sweep()
    attacks = {attack_words(*written(run, "node", "link")) for run in plan.runs}
    defences = {defence_words(*written(run, "law")) for run in plan.runs}

    assert len(attacks) * len(defences) * len(GRAPHS) == len(plan.runs)
    made_up = {f"event2.{name}": 0.5 for name in ("f_off_Hz", "MPSI", "MQSI", "S_max_pu", "V_min_pu", "V_max_pu")}
    keys = ("node", "link", "law")
    rows = pd.DataFrame(
        [
            {"case": run.case, "status": "ran", **dict(zip(keys, written(run, *keys), strict=True)), **made_up}
            for run in plan.runs
        ]
    )
    result = hostile(SweepData(rows=rows, base=plan.base, window="event1"))

    assert len(result.rows) == 3 * len(attacks) * len(GRAPHS)
    assert tuple(result.rows[0]) == ("graph", "numbers", "attack", *dict.fromkeys(map(defence_words, rows["law"])))
    assert {(row["numbers"], cell) for row in result.rows for cell in list(row.values())[3:]} == {
        ("frequency error (Hz)", "**0.500** P Q"),
        ("MPSI / MQSI", "**0.50** / **0.50**"),
        ("S / V (pu)", "0.50 / 0.50..0.50"),
    }
    assert result.markdown().count("| attack |") == 3 * len(GRAPHS)


def f_off(case: str, attack: str, defence: str) -> float:
    """Largest frequency error (Hz) 1.5 to 2 s after the lies began."""
    (run,) = (
        run
        for run in sweep().runs
        if (run.case, attack_words(*written(run, "node", "link")), defence_words(*written(run, "law")))
        == (case, attack, defence)
    )
    time = replace(run.scenario.time, end_s=6.0)
    return run_one(0, replace(run.scenario, time=time), case).measures["event2.f_off_Hz"] or 0.0


def test_one_liar_holds_the_frequency_off_and_W_MSR_stops_it_where_the_graph_is_robust() -> None:
    """On the real plant: far outside the band under the paper's law, within it with F = 1 on the 3-robust graph."""
    assert load_scenario("graphs")[0].cases["robust"].graph == "links"
    assert f_off("robust", "offset 100 kW", "the paper's law") > 0.02
    assert f_off("robust", "offset 100 kW", "F = 1") < 0.01
