"""From a sweep file to its runs: axes, random graphs, and all that is wrong with it."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridpeers.scenarios.schema import ScenarioError
from gridpeers.scenarios.sweep.axes import algebraic_connectivity, connected_graph, connected_graphs
from gridpeers.scenarios.sweep.paths import PathError, put
from gridpeers.scenarios.sweep.sweep_reading import read_sweep, sweeps
from tests.unit.scenarios.sweep.conftest import Write


def problems_of(path: Path) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        read_sweep(path)
    return list(caught.value.problems)


@pytest.mark.parametrize("name", sweeps())
def test_every_sweep_of_the_catalogue_can_be_run(name: str) -> None:
    """Every sweep that comes with gridpeers has no problem and a title."""
    plan = read_sweep(name)

    assert plan.title
    assert plan.name == name


def test_every_combination_comes_once_and_in_order(sweep_file: Write) -> None:
    """Grid, zip and seeds are crossed, the last fastest; zipped keys go together; both ways to write a path hold."""
    plan = read_sweep(
        sweep_file(
            """
[grid]
gains.k_p = [0.0005, 0.0007]
"event[0].t_s" = [0.1, 0.12]
[zip]
"case.IV.graph" = ["full", "ring"]
"case.IV.title" = ["all", "round"]
"""
        )
    )
    got = [
        (
            run.scenario.cases["IV"].gains.k_p,
            run.scenario.events[0].t_s,
            run.scenario.cases["IV"].graph,
            run.scenario.cases["IV"].title,
        )
        for run in plan.runs
    ]

    assert got == [
        (k_p, t, graph, title)
        for k_p in (0.0005, 0.0007)
        for t in (0.1, 0.12)
        for graph, title in (("full", "all"), ("ring", "round"))
    ]
    assert [run.sample for run in plan.runs] == list(range(8))


def test_seeds_follow_that_of_the_scenario(sweep_file: Write) -> None:
    """The key seeds runs every point with n seeds."""
    path = sweep_file("")
    path.write_text("seeds = 3\n" + path.read_text() + '\n"seed" = 7\n[grid]\n"gains.k_p" = [0.0005]\n')
    mixed = problems_of(path)
    path.write_text(path.read_text().replace('"seed" = 7\n', ""))

    assert [run.scenario.seed for run in read_sweep(path).runs] == [1, 2, 3]
    assert mixed == ["mine.toml:1: seeds: seed is set by set.seed already; leave one of them out"]


def test_all_problems_of_samples_are_told_at_once_with_their_values(sweep_file: Write) -> None:
    """An unknown key has a suggestion; a bad value, and one that is bad beside another, name key, line and sample."""
    path = sweep_file('[grid]\n"gains.alpa" = [1.0]\n"time.T_c_s" = [0.02, 20]\n"time.record_s" = [0.01, 0.008]\n')
    line = path.read_text().splitlines().index("[grid]") + 1

    found = problems_of(path)

    assert len(found) == 3
    assert found[0].startswith(f'mine.toml:{line + 1}: grid.gains.alpa: unknown key; did you mean "alpha"?')
    assert found[0].endswith("(in all 4 samples)")
    assert found[1].startswith(
        f"mine.toml:{line + 2}: grid.time.T_c_s: 20 s is not plausible for a control period (0.0005 to 2 s); did you "
        "mean 0.02 (20 ms)? (sample 2: gains.alpa = 1.0, time.T_c_s = 20, time.record_s = 0.01; and in 1 more of 4)"
    )
    assert found[2].startswith(f"mine.toml:{line + 3}: grid.time.record_s: 0.008 s does not divide T_c_s = 0.02 s")


BAD: list[tuple[str, str]] = [
    ("seeds = 0\nscenario = 'islanding'", "seeds: must be from 1 to 10000, got 0"),
    ("scenario = 'islandin'\nseeds = 2", 'no scenario "islandin"; did you mean "islanding"?'),
    ("scenario = 'islanding'", "nothing is varied"),
    ("scenario = 'islanding'\ncases = ['V']\nseeds = 2", 'cases: no case "V"'),
    ('[grid]\n"gains.k_p" = 0.0005', "grid.gains.k_p: must be a list of values"),
    ('[grid]\n"gains.k_p" = { from = 0, to = 1, count = 3, spacing = "log" }', "needs two numbers above 0"),
    ('[grid]\n"gains.k_p" = { from = 0.0001, to = 1, count = 50000 }', "this is 50,000 runs, and more than"),
    ('[zip]\n"gains.k_p" = { from = 0.0001, to = 1, count = 50000 }', "50,000 runs"),
    ('[zip]\n"gains.k_p" = [0.001, 0.002]\n"gains.k_q" = [0.2]', "gains.k_p has 2, gains.k_q has 1"),
    ('[grid]\n"gains.k_p" = [1]\n[zip]\n"gains.k_p" = [2]', "gains.k_p is set by grid.gains.k_p already"),
    ('[grid]\n"link[0].delay" = [0.1]', "there is no link[0]; give link as a list first"),
    ('[grid]\n"event[1].t_s" = [0.2]', "there is no event[1]; event has 1 entries, from event[0]"),
    ('[grid]\n"case.VI.graph" = ["ring"]', "there is no case.VI; did you mean"),
    ('[grid]\n"gains..k_p" = [1]', "is no path of a key"),
    ("[graph]\nlinks = [7, 37]", "9 inverters have 8 to 36 links, got 7: fewer cannot join them"),
]


@pytest.mark.parametrize(("text", "said"), BAD)
def test_a_problem_is_told_by_its_key(sweep_file: Write, text: str, said: str) -> None:
    """Key, value, and what would be right."""
    assert any(said in problem for problem in problems_of(sweep_file(text)))


def test_a_scenario_beside_the_sweep_is_found_and_its_problems_are_told(sweep_file: Write, tmp_path: Path) -> None:
    """A relative path starts at the sweep file, and the problems of both files come together."""
    (tmp_path / "base.toml").write_text("[time]\nend_s = 1.0\nT_c = 0.02\n")
    found = problems_of(sweep_file('scenario = "base.toml"\nseeds = 0'))

    assert any('base.toml:3: time.T_c: unknown key; did you mean "T_c_s"' in problem for problem in found)
    assert any("seeds: must be from 1" in problem for problem in found)


def test_any_key_of_a_tree_can_be_set_that_a_later_version_may_know() -> None:
    """Entries of lists and tables in tables: the tree decides what there is, not today's scenario."""
    tree: dict[str, Any] = {"link": [{"delay": 0.0, "loss": {"p": 0.0}}]}
    put(tree, "link[0].loss.p", 0.1)
    put(tree, "netem.window_s", 2.0)

    assert tree == {"link": [{"delay": 0.0, "loss": {"p": 0.1}}], "netem": {"window_s": 2.0}}
    with pytest.raises(PathError, match=r"there is no link\[1\]; link has 1 entries, from link\[0\]"):
        put(tree, "link[1].delay", 0.1)


@settings(max_examples=20)
@given(n=st.integers(2, 12), part=st.floats(0.0, 1.0), seed=st.integers(0, 10**6))
def test_a_drawn_graph_is_connected_and_has_its_links(n: int, part: float, seed: int) -> None:
    """From a tree to all pairs: so many different links, all nodes within reach of each other (lambda_2 > 0)."""
    links = n - 1 + int(part * (n * (n - 1) // 2 - n + 1))

    edges = connected_graph(n, links, random.Random(seed))

    assert len(set(edges)) == links
    assert all(0 <= i < j < n for i, j in edges)
    assert algebraic_connectivity(n, edges) > 1e-6


def test_graphs_of_a_count_differ_and_stay_when_more_are_asked_for() -> None:
    """No graph is run twice; asking for more, or for other counts, redraws none; with all links there is one."""
    few, many = connected_graphs(9, 34, 5, seed=3), connected_graphs(9, 34, 20, seed=3)

    assert len(set(many)) == 20
    assert many[:5] == few
    assert connected_graphs(9, 34, 5, seed=4) != few
    assert [len(connected_graphs(3, links, 10, seed=1)) for links in (2, 3)] == [3, 1]
