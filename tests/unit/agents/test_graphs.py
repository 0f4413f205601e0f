"""The rules of the communication graph: ours, and one of somebody's own, which may fail."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control, GraphRule
from gridpeers.agents.graphs import GRAPHS, GraphError, check_graph, in_neighbours, is_pairwise, make_graph
from gridpeers.wire.plugins.plugin import Plugin, plugin_of, plugin_problems
from tests.toy.toy_configs import agent_config
from tests.toy.toy_messages import measurement

PAPER = {
    f"inv{i}": SimpleNamespace(kind="GFM" if i in (1, 4, 7) else "GFL", microgrid=f"mg{(i + 2) // 3}")
    for i in range(1, 10)
}
"""The paper's nine inverters: GFM 1, 4, 7, one in each of three microgrids."""

RULES: tuple[GraphRule, ...] = ("full", "none", "GFM-only", "clustered", "ring", "links")
LINKS = (("inv1", "inv4"), ("inv4", "inv7"), ("inv9", "inv2"))


def rule(graph: GraphRule) -> Control:
    return Control(secondary="all", graph=graph, links=LINKS if graph == "links" else ())


@pytest.mark.parametrize(("graph", "name", "expected"), [
    ("full", "inv5", {"inv1", "inv2", "inv3", "inv4", "inv6", "inv7", "inv8", "inv9"}),
    ("none", "inv5", set()),
    ("GFM-only", "inv4", {"inv1", "inv7"}),
    ("GFM-only", "inv5", set()),
    ("clustered", "inv4", {"inv5", "inv6", "inv1", "inv7"}),
    ("clustered", "inv5", {"inv4", "inv6"}),
    ("ring", "inv5", {"inv4", "inv6"}),
    ("ring", "inv1", {"inv2", "inv9"}),
    ("links", "inv4", {"inv1", "inv7"}),
    ("links", "inv9", {"inv2"}),
    ("links", "inv5", set()),
])  # fmt: skip
def test_each_rule_gives_the_neighbours_it_is_named_for(graph: GraphRule, name: str, expected: set[str]) -> None:
    """Each rule, on the paper's nine inverters (its section 4)."""
    assert set(in_neighbours(rule(graph), name, PAPER)) == expected


@given(st.permutations([f"inv{i}" for i in range(1, 13)]))
def test_a_ring_runs_in_natural_order(names: list[str]) -> None:
    """The ring joins inv2 to inv3, and inv10 to inv9 and inv11, for any order of the roster."""
    members = {name: SimpleNamespace(kind="GFL", microgrid="mg1") for name in names}
    ring = Control(secondary="all", graph="ring")

    assert set(in_neighbours(ring, "inv10", members)) == {"inv9", "inv11"}
    assert set(in_neighbours(ring, "inv1", members)) == {"inv2", "inv12"}


def test_missing_links_are_left_out_of_any_rule_both_ways() -> None:
    """The full graph without the link 4-7, the paper's link failure: only these two agents miss each other."""
    control = Control(secondary="all", graph="full", without=(("inv4", "inv7"),))

    missing = {
        (name, other) for name in PAPER for other in PAPER if other not in (name, *in_neighbours(control, name, PAPER))
    }

    assert missing == {("inv4", "inv7"), ("inv7", "inv4")}


MODULE = '''
from typing import Annotated
from gridpeers import Range

def star(members):
    return {name: set(members) - {name} if name == "inv1" else ["inv1"] for name in members}

class Next:
    """Listen to the k after it."""
    k: Annotated[int, Range(1, 8), "How many."] = 1
    def __call__(self, members):
        names = list(members)
        return {a: [names[(i + j) % len(names)] for j in range(1, self.k + 1)] for i, a in enumerate(names)}

def of_two(members, hub):
    return {}

def of_three(members):
    return {name: () for name in members} if len(members) != 2 else members["nobody"]

class Wrong:
    """It cannot be called."""
'''


@pytest.fixture
def folder(tmp_path: Path) -> str:
    (tmp_path / "my_graphs.py").write_text(MODULE, encoding="utf-8")
    return str(tmp_path)


def control(use: str, folder: str, **parameters: int) -> Control:
    plugin = plugin_of({"use": use, **parameters}, folder)
    return Control(secondary="all", graph=plugin.use, own_graph=plugin)


def nameplates(n: int) -> dict[str, object]:
    return {f"inv{i}": Agent(agent_config(f"inv{i}")).nameplate for i in range(n, 0, -1)}


def test_a_function_and_a_class_with_parameters_are_rules(folder: str) -> None:
    """A rule need not be symmetric or pairwise; `without` still removes links."""
    star, following = control("my_graphs:star", folder), control("my_graphs:Next", folder, k=2)
    members = nameplates(4)

    assert not is_pairwise(star)
    assert in_neighbours(star, "inv3", members) == ("inv1",)  # type: ignore[arg-type]
    assert in_neighbours(star, "inv1", members) == ("inv4", "inv3", "inv2")  # type: ignore[arg-type]
    assert in_neighbours(following, "inv3", members) == ("inv4", "inv1")  # type: ignore[arg-type]
    assert in_neighbours(replace(star, without=(("inv3", "inv1"),)), "inv3", members) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(("use", "said"), [
    ("my_graphs:Wrong", "my_graphs:Wrong is no graph: the class needs a method __call__(self, members)"),
    ("my_graphs:of_two", "my_graphs:of_two is no graph: it is called with one argument, the members: missing"),
    ("rings", 'there is no graph "rings"; did you mean "ring"? The graphs are full, none, GFM-only, clustered'),
])  # fmt: skip
def test_an_impossible_rule_is_refused_in_one_line(folder: str, use: str, said: str) -> None:
    """The problem of the rule, and a remedy."""
    (wrong,) = plugin_problems(GRAPHS, plugin_of({"use": use}, folder))
    make_graph(Plugin(use="my_graphs:star", folder=folder))

    assert said in wrong[1]
    assert "\n" not in wrong[1]


@pytest.mark.parametrize(("rule", "said"), [
    (lambda members: {"inv1": ["inv9"]}, "graph mine lets inv1 listen to inv9, which is no agent of the run"),
    (lambda members: {"inv9": []}, "graph mine names inv9, which is no agent of the run"),
    (lambda members: {"inv1": ["inv1"]}, "graph mine lets inv1 listen to itself; leave it out"),
    (lambda members: {"inv1": 3}, "of inv1, inv2 failed: TypeError: 'int' object is not iterable"),
    (lambda members: 1 / 0, "of inv1, inv2 failed: ZeroDivisionError: division by zero"),
])  # fmt: skip
def test_a_result_that_is_no_graph_is_reported_in_one_line(rule: object, said: str) -> None:
    """The error names the agent, and what the rule returned or raised."""
    with pytest.raises(GraphError) as caught:
        check_graph(rule, nameplates(2), "mine")  # type: ignore[arg-type]

    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_agent_with_a_failing_rule_is_idle_and_reports_it(folder: str) -> None:
    """The run continues: one state reports the fault, and the agent is idle until the rule works again."""
    agent = Agent(agent_config("inv1", control("my_graphs:of_three", folder)))
    for name in ("inv2", "inv3"):
        agent.meet(Agent(agent_config(name)).nameplate)
    now = measurement(P_set=3e4)

    assert agent.in_neighbours(("inv1", "inv2", "inv3")) == ()
    assert agent.tick(now).fault == ""
    assert agent.in_neighbours(("inv1", "inv3")) == ()
    first, second = agent.tick(now), agent.tick(now)
    agent.in_neighbours(("inv1", "inv2", "inv3"))
    third = agent.tick(now)

    assert first.fault == "graph my_graphs:of_three (my_graphs.py:19) of inv1, inv3 failed: KeyError: 'nobody'"
    assert (first.idle, first.P_set) == (True, 3e4)
    assert (second.idle, second.fault) == (True, "")
    assert (third.idle, third.fault) == (False, "")


def test_two_modules_of_one_name_are_not_taken_for_each_other(folder: str, tmp_path: Path) -> None:
    """A module of the same name in another scenario's folder is refused."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "my_graphs.py").write_text("def star(members):\n    return {}\n", encoding="utf-8")
    make_graph(Plugin(use="my_graphs:star", folder=folder))
    ((_, said),) = plugin_problems(GRAPHS, Plugin(use="my_graphs:star", folder=str(other)))

    assert "Python has another module my_graphs, from " in said
