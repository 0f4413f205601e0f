from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.agents.agent_config import Control, GraphRule
from gridpeers.agents.topology import adjacency, in_neighbours, is_pairwise, laplacian, link_problems, natural_order

PAPER = {
    f"inv{i}": SimpleNamespace(kind="GFM" if i in (1, 4, 7) else "GFL", microgrid=f"mg{(i + 2) // 3}")
    for i in range(1, 10)
}
"""The paper's nine inverters: GFM 1, 4, 7, one in each of three microgrids."""

RULES: tuple[GraphRule, ...] = ("full", "none", "GFM-only", "clustered", "ring", "links")
LINKS = (("inv1", "inv4"), ("inv4", "inv7"), ("inv9", "inv2"))


def rule(graph: GraphRule) -> Control:
    """Control by one of the rules, with links where it needs them."""
    return Control(secondary="all", graph=graph, links=LINKS if graph == "links" else ())


@pytest.mark.parametrize(
    ("graph", "name", "expected"),
    [
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
    ],
)
def test_each_rule_gives_the_neighbours_it_is_named_for(graph: GraphRule, name: str, expected: set[str]) -> None:
    """The rules, on the paper's nine inverters (its section 4)."""
    assert set(in_neighbours(rule(graph), name, PAPER)) == expected


@pytest.mark.parametrize(
    ("graph", "links", "fiedler"), [("full", 36, 9.0), ("clustered", 12, 0.551), ("ring", 9, 0.468)]
)
def test_graphs_have_the_papers_number_of_links_and_speed(graph: GraphRule, links: int, fiedler: float) -> None:
    """Links and the second smallest eigenvalue of L of full, reduced and ring, as in the theory's table."""
    L = np.array(laplacian(rule(graph), PAPER))

    assert np.trace(L) == 2 * links
    assert np.sort(np.linalg.eigvalsh(L))[1] == pytest.approx(fiedler, abs=5e-4)


@pytest.mark.parametrize("graph", RULES)
def test_who_listens_is_heard(graph: GraphRule) -> None:
    """Every rule is symmetric and nobody listens to itself; the Laplacian's rows sum to zero."""
    A, L = np.array(adjacency(rule(graph), PAPER)), np.array(laplacian(rule(graph), PAPER))

    assert np.array_equal(A, A.T)
    assert not A.diagonal().any()
    assert np.array_equal(L, np.diag(A.sum(axis=1)) - A)


@pytest.mark.parametrize("graph", RULES)
def test_neighbours_come_in_the_rosters_order(graph: GraphRule) -> None:
    """Sums over neighbours round alike in every process, whoever was heard first."""
    names = list(PAPER)
    for name in names:
        neighbours = in_neighbours(rule(graph), name, PAPER)

        assert sorted(neighbours, key=names.index) == list(neighbours)


@pytest.mark.parametrize("graph", [graph for graph in RULES if graph != "ring"])
def test_a_pairwise_rule_needs_nobody_else(graph: GraphRule) -> None:
    """For pairwise rules two nameplates decide a link, so it can be made before the roster is known."""
    assert is_pairwise(rule(graph))
    for a in PAPER:
        among_all = in_neighbours(rule(graph), a, PAPER)
        for b in PAPER:
            if a != b:
                assert (b in among_all) == bool(in_neighbours(rule(graph), a, {a: PAPER[a], b: PAPER[b]}))


@given(st.permutations([f"inv{i}" for i in range(1, 13)]))
def test_a_ring_runs_in_natural_order(names: list[str]) -> None:
    """The ring joins inv2 to inv3 and inv10 to inv9 and inv11, in whatever order the roster is written."""
    members = {name: SimpleNamespace(kind="GFL", microgrid="mg1") for name in names}
    ring = Control(secondary="all", graph="ring")

    assert set(in_neighbours(ring, "inv10", members)) == {"inv9", "inv11"}
    assert set(in_neighbours(ring, "inv1", members)) == {"inv2", "inv12"}


def test_a_ring_closes_around_who_left() -> None:
    """With inv5 gone, inv4 and inv6 are neighbours."""
    members = {name: plate for name, plate in PAPER.items() if name != "inv5"}

    assert set(in_neighbours(rule("ring"), "inv4", members)) == {"inv3", "inv6"}


@pytest.mark.parametrize(("n", "expected"), [(1, ()), (2, ("inv2",))])
def test_a_small_ring_has_no_double_links(n: int, expected: tuple[str, ...]) -> None:
    """Alone there is no neighbour, in a pair the other is one, not two."""
    members = {f"inv{i + 1}": SimpleNamespace(kind="GFL", microgrid="mg1") for i in range(n)}

    assert in_neighbours(rule("ring"), "inv1", members) == expected


def test_mixed_names_sort_naturally() -> None:
    """Digits count as numbers, also between words."""
    names = ["mg10_inv1", "mg2_inv10", "mg2_inv9", "inv"]

    assert sorted(names, key=natural_order) == ["inv", "mg2_inv9", "mg2_inv10", "mg10_inv1"]


def test_all_wrong_links_are_told_at_once() -> None:
    """Unknown ends and links to oneself are problems that name the link and what would be right."""
    control = Control(secondary="all", graph="links", links=(("inv1", "inv2"), ("inv2", "inv9"), ("inv1", "inv1")))

    assert link_problems(control, ("inv1", "inv2")) == (
        'links[1]: no inverter "inv9"; inverters are inv1, inv2',
        "links[2]: inv1 is linked to itself; a link joins two inverters",
    )


def test_missing_links_are_left_out_of_any_rule_both_ways() -> None:
    """The full graph less the link 4-7, the paper's link failure: neither hears the other, everybody else hears all."""
    control = Control(secondary="all", graph="full", without=(("inv4", "inv7"),))

    missing = {
        (name, other) for name in PAPER for other in PAPER if other not in (name, *in_neighbours(control, name, PAPER))
    }

    assert missing == {("inv4", "inv7"), ("inv7", "inv4")}
