"""What follows from the graph alone, against the numbers of the issue's theory: kappa 12 1/s, the paper's graphs."""

import dataclasses
import math

import numpy as np
import pytest

from gridpeers.lab.predict.closed_form import delay_limit_closed, equivalent_delay, groups, modes, settling
from tests.unit.lab.predict.predicted_graphs import GRAPHS, inverters

TABLE = {
    "full": (36, 9.0, 9.0, 0.04, 1.01, 14.5, 18.2),
    "full less 4-7": (35, 7.0, 9.0, 0.05, 1.01, 14.5, 18.2),
    "reduced": (12, 0.551, 5.449, 0.61, 1.05, 24.0, 30.6),
    "reduced less 4-7": (11, 0.268, 5.449, 1.24, 1.24, 24.0, 30.6),
    "ring": (9, 0.468, 3.879, 0.71, 1.05, 33.7, 43.0),
    "star": (8, 1.0, 9.0, 0.33, 1.14, 14.5, 18.4),
    "path": (8, 0.121, 3.879, 2.76, 2.85, 33.7, 43.0),
}
"""Links, lambda_2, lambda_max, sharing 2 % (s), frequency 2 % (s), limit of kind 2 (ms), Euler's step (ms).

The theory's table has 14.6 ms for the star's limit; pi / (2 kappa 9) is 14.54 ms."""


@pytest.mark.parametrize("graph", TABLE)
def test_eigenvalues_settling_times_and_limits_are_those_of_the_theory(graph: str) -> None:
    """Every number of the theory's table follows from graph, ratings and kappa, to its last printed digit."""
    links, lambda_2, lambda_max, sharing, frequency, kind_2, euler = TABLE[graph]
    found = modes(inverters(graph, kappa=12.0))

    assert found.links == links
    assert found.lambda_2 == pytest.approx(lambda_2, abs=5e-4)
    assert found.lambda_max == pytest.approx(lambda_max, abs=5e-4)
    assert settling(found.sharing_rate) == pytest.approx(sharing, abs=6e-3)
    assert settling(found.slowest_rate) == pytest.approx(frequency, abs=6e-3)
    assert 1e3 * delay_limit_closed(inverters(graph, kappa=12.0), "disagreement") == pytest.approx(kind_2, abs=0.05)
    assert 1e3 * found.euler_step_s == pytest.approx(euler, abs=0.05)


@pytest.mark.parametrize(("kappa", "limit"), [(12.0, 0.39), (40.0, 0.12)])
def test_the_local_loop_has_the_theorys_limit(kappa: float, limit: float) -> None:
    """Pi N / (2 kappa n_L) for three leaders of nine: 0.39 s and 0.12 s."""
    assert delay_limit_closed(inverters("full", kappa=kappa), "local loop") == pytest.approx(limit, abs=5e-3)


def test_lost_messages_are_as_old_as_the_theory_says() -> None:
    """At 20 ms, p = 0.5, 0.7, 0.9 add 20, 47 and 180 ms, to the 20 ms that the theory's 40, 67, 200 ms start from."""
    assert [round(1e3 * equivalent_delay(0.02, p)) for p in (0.5, 0.7, 0.9)] == [20, 47, 180]
    with pytest.raises(ValueError, match=r"got 30; write 0\.3 for 30 %"):
        equivalent_delay(0.02, 30)


@pytest.mark.parametrize("seed", range(5))
def test_the_number_of_zero_eigenvalues_is_the_number_of_parts(seed: int) -> None:
    """lambda_2 is 0 exactly when the graph is not connected."""
    rng = np.random.default_rng(seed)
    A = np.triu(rng.random((9, 9)) < 0.18, 1).astype(float)
    random = dataclasses.replace(inverters("full"), A=A + A.T)

    assert (modes(random).lambda_2 == 0.0) == (len(groups(random)) > 1)
    assert sorted(name for part in groups(random) for name in part) == sorted(random.names)


def test_where_only_the_leaders_act_the_frequency_answers_by_their_weight() -> None:
    """Without the followers the frequency mode is kappa times the leaders' part of the ratings: 1800 of 3900 kW."""
    whole = inverters("full")
    leaders = dataclasses.replace(whole, acts=whole.GFM)

    assert modes(leaders).frequency_rate == pytest.approx(whole.kappa[0] * 1800.0 / 3900.0)
    assert modes(leaders).slowest_rate == pytest.approx(modes(leaders).frequency_rate, rel=1e-9)


def test_nobody_to_control_is_told_in_words() -> None:
    """Without anybody who runs the law there are no modes, and no number is made up."""
    idle = dataclasses.replace(inverters("full"), acts=np.zeros(9, bool))

    with pytest.raises(ValueError, match="nobody runs the secondary law"):
        modes(idle)


def test_one_leader_alone_has_nobody_to_share_with() -> None:
    """Its sharing mode is infinitely fast, its frequency mode kappa."""
    alone = inverters("full").part(np.arange(9) == 0)

    assert modes(alone).sharing_rate == math.inf
    assert modes(alone).slowest_rate == pytest.approx(alone.kappa[0])
    assert set(GRAPHS) >= set(TABLE)
