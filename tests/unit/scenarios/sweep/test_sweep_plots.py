"""Which figures a sweep gets, and what their numbers are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.scenarios.sweep import sweep_plots
from gridpeers.scenarios.sweep.sweep_case import FATE
from gridpeers.scenarios.sweep.sweep_plots import curves, indexes_of, spread_of, values_of


def table(parameters: dict[str, list[Any]], **indexes: list[float | None]) -> pd.DataFrame:
    """A table as a sweep writes it, case IV only."""
    n = len(next(iter(parameters.values())))
    head = {"sample": list(range(n)), "case": ["IV"] * n, "seed": [1] * n}
    fate = {name: ["ran"] * n for name in FATE}
    named = {f"event1.{name}": column for name, column in indexes.items()}
    measures = (named or {"event1.MPSI": [0.1] * n}) | {"event1.p.inv1": [0.5] * n}
    return pd.concat([pd.DataFrame(head | parameters | fate), pd.DataFrame(measures, dtype=float)], axis=1)


CHOICES: list[tuple[dict[str, list[Any]], list[str]]] = [
    (
        {"graph.links": [8, 8, 9, 9], "graph.number": [0, 1, 0, 1], "graph.lambda_2": [0.1, 0.2, 0.3, 0.4]},
        ["graph.links"],
    ),
    ({"a": [1, 1, 2, 2], "b": ["ring", "full", "ring", "full"]}, ["a", "b"]),
    ({"a": list(range(90)), "b": list(range(90))}, ["a", "b"]),
    ({"a": [1, 1], "b": [2, 2]}, []),
]


@pytest.mark.parametrize(("parameters", "varied"), CHOICES)
def test_each_varied_parameter_has_a_figure(
    tmp_path: Path, parameters: dict[str, list[Any]], varied: list[str]
) -> None:
    """A number, a text, or random draws; repeats, such as the number of a graph, are no axes."""
    drawn = table(parameters)

    files = sweep_plots.draw_all(drawn, tmp_path)

    assert indexes_of(drawn) == {"event1": ["MPSI"]}
    assert [file.name for file in files] == [f"event1_{name}.png" for name in varied]
    assert all(file.stat().st_size > 5000 for file in files)


def test_axes_have_units() -> None:
    """A gain has the unit of its field, an index that of its name."""
    figure = curves(table({"gains.k_p": [0.001, 0.002]}, f_min_Hz=[59.7, 59.8]), "event1", "gains.k_p")

    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("gains.k_p (s)", "f_min_Hz (Hz)")


def test_a_sweep_of_which_nothing_ran_is_drawn_too(tmp_path: Path) -> None:
    """No index at all, or none but missing ones: no figure or an empty one, and no error."""
    column: list[float | None] = [None] * 4
    grid: dict[str, list[Any]] = {"a": [1, 2, 3, 4]}
    bare = table(grid).drop(columns=["event1.MPSI", "event1.p.inv1"])

    assert sweep_plots.draw_all(bare, tmp_path) == ()
    assert len(sweep_plots.draw_all(table(grid, MPSI=column, t_restore_s=column), tmp_path)) == 1


@given(st.lists(st.tuples(st.integers(0, 3), st.none() | st.floats(0.0, 9.0)), min_size=1, max_size=30))
def test_a_time_that_never_came_counts_as_later_than_all_others(runs: list[tuple[int, float | None]]) -> None:
    """Median and range by sorting, None last: no run is left out because it was bad."""
    times = [t for _, t in runs]
    rows = pd.DataFrame({"a": [a for a, _ in runs], "event1.t_restore_s": times, "event1.MPSI": times})

    low, median, high = spread_of(rows["a"], values_of(rows, "event1.t_restore_s"))

    for a in median.index:
        mine = sorted(np.inf if t is None else t for b, t in runs if b == a)
        middle = [mine[(len(mine) - 1) // 2], mine[len(mine) // 2]]
        assert median[a] == pytest.approx(np.nan if np.inf in middle else sum(middle) / 2, nan_ok=True)
        came = [t for t in mine if t < np.inf]
        assert [low[a], high[a]] == ([came[0], came[-1]] if came else pytest.approx([np.nan] * 2, nan_ok=True))
    assert np.isnan(values_of(rows, "event1.MPSI")).sum() == sum(t is None for _, t in runs)
