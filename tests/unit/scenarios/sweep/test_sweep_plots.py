"""Which plots a sweep gets, and what their numbers are."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.sweep import sweep_plots
from gridpeers.scenarios.sweep.sweep_case import FATE
from gridpeers.scenarios.sweep.sweep_plots import curves, indexes_of, spread_of
from gridpeers.scenarios.sweep.sweep_table import label_of


def table(parameters: dict[str, list[Any]], **indexes: list[float | None]) -> pd.DataFrame:
    """A table as a sweep writes it, case IV only."""
    n = len(next(iter(parameters.values())))
    head = {"sample": list(range(n)), "case": ["IV"] * n, "seed": [1] * n}
    fate = {name: ["ran"] * n for name in FATE}
    named = {f"event1.{name}": column for name, column in indexes.items()}
    measures = (named or {"event1.MPSI": [0.1] * n}) | {"event1.p.inv1": [0.5] * n}
    return pd.concat([pd.DataFrame(head | parameters | fate), pd.DataFrame(measures, dtype=float)], axis=1)


CHOICES: list[tuple[dict[str, list[Any]], list[tuple[str, ...]]]] = [
    (
        {"graph.links": [8, 8, 9, 9], "graph.number": [0, 1, 0, 1], "graph.lambda_2": [0.1, 0.2, 0.3, 0.4]},
        [("graph.links",)],
    ),
    ({"a": [1, 1, 2, 2], "b": [0.1, 0.2, 0.1, 0.2]}, [("a", "b")]),
    ({"a": [1, 1, 2, 2], "b": ["ring", "full", "ring", "full"]}, [("a",), ("b",)]),
    ({"a": list(range(90)), "b": list(range(90))}, [("a",), ("b",)]),
    ({"a": [1, 1], "b": [2, 2]}, []),
]


def test_an_axis_shows_all_of_a_metric_of_somebodys_own() -> None:
    """0 neither flattens a frequency nor cuts off what is less; ours begin at 0, and their highest value is seen."""
    own = {"f_min_Hz": [59.7, 59.8], "slope": [-2.0, 1.0], "V_error": [0.00208, 0.00209]}
    figure = curves(table({"a": [0.1, 0.2]}, **own), "event1", "a")

    bounds = {panel.get_ylabel(): panel.get_ylim() for panel in figure.axes if panel.get_visible()}
    assert 59.0 < bounds["f_min (Hz)"][0] < 59.7
    assert bounds["slope"][0] < -2.0
    assert bounds[label_of("V_error")][0] == 0.0
    assert bounds[label_of("V_error")][1] > 0.00209 * 1.02


@pytest.mark.parametrize(("parameters", "figures"), CHOICES)
def test_plots_are_chosen_by_what_is_varied(
    tmp_path: Path, parameters: dict[str, list[Any]], figures: list[tuple[str, ...]]
) -> None:
    """One parameter, or a text, or random draws: curves; two numbers on a grid: a map; repeats are no axes."""
    drawn = table(parameters)

    assert sweep_plots.figures_of(drawn) == figures
    assert indexes_of(drawn) == {"event1": ["MPSI"]}
    files = sweep_plots.draw_all(drawn, tmp_path)
    assert len(files) == len(figures)
    assert all(file.stat().st_size > 5000 for file in files)


def test_a_sweep_of_which_nothing_ran_is_drawn_too(tmp_path: Path) -> None:
    """No index at all, or none but missing ones: no figure or an empty one, and no error."""
    column: list[float | None] = [None] * 4
    grid: dict[str, list[Any]] = {"a": [1, 1, 2, 2], "b": [0.1, 0.2, 0.1, 0.2]}
    bare = table(grid).drop(columns=["event1.MPSI", "event1.p.inv1"])

    assert sweep_plots.draw_all(bare, tmp_path) == ()
    assert len(sweep_plots.draw_all(table(grid, MPSI=column, t_restore_s=column), tmp_path)) == 1
    assert len(sweep_plots.draw_all(table({"a": [1, 2, 3, 4]}, MPSI=column, t_restore_s=column), tmp_path)) == 1


def test_axes_say_what_is_varied_in_words_with_units_and_no_key_of_the_file() -> None:
    """Every key of the catalogue's sweeps but a list of entries has words; time, gain and delay have their unit."""
    tables = [tomllib.loads(path.read_text(encoding="utf-8")) for path in (CATALOGUE / "sweeps").glob("*.toml")]
    keys = {key for sweep in tables for part in ("grid", "zip") for key in sweep.get(part, {})}

    assert len(keys) > 5
    assert not [key for key in keys - {"link", "node", "law"} if key in label_of(key)]
    assert label_of("law") == "control law"
    assert label_of("gains.k_p") == "gain of P_set, k_p (s)"
    assert label_of("degraded_communication.T_age_s") == "T_age of [degraded_communication] (s)"
    assert label_of("plant.gfl.T_pf") == "T_pf of [plant.gfl] (s)"


@given(st.lists(st.tuples(st.integers(0, 3), st.none() | st.floats(0.0, 9.0)), min_size=1, max_size=30))
def test_a_time_that_never_came_counts_as_later_than_all_others(runs: list[tuple[int, float | None]]) -> None:
    """Median and range by sorting, None last: no run is left out because it was bad."""
    times = [t for _, t in runs]
    rows = pd.DataFrame({"a": [a for a, _ in runs], "event1.t_restore_s": times, "event1.MPSI": times})

    spread = spread_of(rows["a"], sweep_plots.values_of(rows, "event1.t_restore_s"))

    for a in spread.index:
        row, mine = spread.loc[a], sorted(np.inf if t is None else t for b, t in runs if b == a)
        middle = [mine[(len(mine) - 1) // 2], mine[len(mine) // 2]]
        assert row["median"] == (np.inf if np.inf in middle else sum(middle) / 2)
        assert row["never"] == mine.count(np.inf)
        came = [t for t in mine if t < np.inf]
        assert [row["low"], row["high"]] == ([came[0], came[-1]] if came else pytest.approx([np.nan] * 2, nan_ok=True))
    assert np.isnan(sweep_plots.values_of(rows, "event1.MPSI")).sum() == sum(t is None for _, t in runs)
