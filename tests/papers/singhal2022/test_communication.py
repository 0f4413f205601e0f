"""What the paper says of reduced communication and of a link failure, a test for each claim."""

import pytest

from gridpeers.agents.graphs import adjacency
from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs

from .conftest import Experiment, expected

EVENT = "event1"


@pytest.mark.parametrize(("case", "links"), [("full", 36), ("reduced", 12), ("adaptive", 12), ("link-failure", 35)])
def test_graphs_have_the_papers_links(case: str, links: int) -> None:
    """36 links; 12 with clusters around three leaders; 35 without the link 4-7. Section 4, Table IV."""
    _, agents = configs(*load_scenario("reduced-communication"), case)
    members = {agent.name: agent for agent in agents}

    assert sum(map(sum, adjacency(agents[0].control, members))) == 2 * links


def test_steady_frequency_and_sharing_do_not_depend_on_the_links(communication: Experiment) -> None:
    """abs(f-60) and MPSI are 0 with all links, few, and one missing. Table IV, figure."""
    for case in ("full", "reduced", "link-failure", "untuned", "adaptive"):
        steady = communication.steady[case][EVENT]
        assert steady.f_error_Hz < 0.001
        assert steady.MPSI < 0.001


def test_a_missing_link_costs_least_and_reduced_communication_most(communication: Experiment) -> None:
    """MQSI: full, then link failure, then reduced. Table IV, (17)."""
    full, failure, reduced = (communication.steady[case][EVENT].MQSI for case in ("full", "link-failure", "reduced"))

    assert full <= failure < reduced < 0.2


def test_the_gains_of_the_full_graph_share_vars_worse_over_few_links(communication: Experiment) -> None:
    """Re-tuned alpha and beta more than halve MQSI and leave V_error as it was. Section 4, (15)."""
    before, after = (communication.steady[case][EVENT] for case in ("untuned", "reduced"))

    assert after.MQSI < 0.5 * before.MQSI
    assert after.V_error == pytest.approx(before.V_error, abs=0.0005)


def test_an_adaptive_alpha_is_better_in_both_at_once(communication: Experiment) -> None:
    """Two seconds after islanding V_error and MQSI are below those of the re-tuned constant alpha. Section 4, (15)."""
    nameplates = communication.nameplates
    at: dict[str, list[float]] = {}
    for case in ("reduced", "adaptive"):
        history = communication.histories[case]
        rows = (history.t > 2.9) & (history.t <= 3.1)
        at[case] = [float(of(history, nameplates)[rows].mean()) for of in (metrics.V_error, metrics.MQSI)]

    assert at["adaptive"][0] < at["reduced"][0]
    assert at["adaptive"][1] < at["reduced"][1]


def test_over_few_links_sharing_from_equal_powers_is_not_slower(communication: Experiment) -> None:
    """Ours needs no 0.5 s more, as the paper's does: a known miss, explained in docs/reproduction.md. Figure."""
    full, reduced = (communication.found.settled[case][EVENT].t_share_s for case in ("full", "reduced"))

    assert full is not None
    assert reduced is not None
    assert abs(full - reduced) < 0.1


def test_over_few_links_sharing_from_unequal_powers_takes_half_a_second_more(communication: Experiment) -> None:
    """After an inverter returned at no load, reduced needs 0.4 to 0.6 s more than full. Section 4, (12), (13)."""
    full, reduced = (communication.found.settled[case]["return"].t_share_s for case in ("full", "reduced"))

    assert full is not None
    assert reduced is not None
    assert reduced - full == pytest.approx(0.5, abs=0.1)


def test_every_claim_holds_but_for_the_known_miss(communication: Experiment) -> None:
    """`gridpeers run reduced-communication` reports what the documentation says. Section 4, Table IV."""
    assert communication.statuses("communication") == expected("communication")
