"""Delays: the realised law against the configured one."""

from __future__ import annotations

import math
from itertools import pairwise
from statistics import NormalDist

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gridpeers.netem.models.delay import Lognormal, Normal, Pareto, Trace, Uniform
from tests.unit.netem.link_messages import T_C, channel, delays, fates, steady

N = 4000

LAWS = {
    "uniform": (Uniform(low_s=0.01, high_s=0.05), stats.uniform(0.01, 0.04)),
    "normal": (Normal(mean_s=0.1, std_s=0.02), stats.truncnorm(-5.0, math.inf, 0.1, 0.02)),
    "normal, truncated": (Normal(mean_s=0.01, std_s=0.02), stats.truncnorm(-0.5, math.inf, 0.01, 0.02)),
    "lognormal": (Lognormal(median_s=0.02, sigma=0.6, offset_s=0.01), stats.lognorm(0.6, 0.01, 0.02)),
    "pareto": (Pareto(minimum_s=0.02, shape=3.0), stats.pareto(3.0, 0.0, 0.02)),
}


@pytest.mark.parametrize("name", LAWS)
def test_delays_follow_their_law(name: str) -> None:
    """A Kolmogorov-Smirnov test accepts the drawn delays as samples of scipy's own form of the law."""
    model, law = LAWS[name]

    assert stats.kstest(delays(channel(delay=model), N), law.cdf).pvalue > 0.01


@pytest.mark.parametrize("name", LAWS)
def test_the_quantile_is_that_of_the_law(name: str) -> None:
    """It agrees with scipy's from u = 1e-9 to 1 - 1e-9."""
    model, law = LAWS[name]

    for u in (1e-9, 0.001, 0.3, 0.5, 0.9, 1 - 1e-9):
        assert model.quantile(u) == pytest.approx(law.ppf(u), rel=1e-6)


@pytest.mark.parametrize("phi", [0.5, 0.95])
@pytest.mark.parametrize("name", ["normal, truncated", "pareto"])
def test_correlated_delays_keep_their_law_and_come_from_an_ar1_process(name: str, phi: float) -> None:
    """The normal scores of correlated delays are an AR(1) process with independent standard normal innovations."""
    model, law = LAWS[name]
    drawn = delays(channel(delay=msgspec.structs.replace(model, correlation=phi)), N)
    scores = [NormalDist().inv_cdf(share) for share in law.cdf(drawn)]
    innovations = [(new - phi * old) / math.sqrt(1 - phi**2) for old, new in pairwise(scores)]

    assert stats.pearsonr(scores[1:], scores[:-1]).statistic == pytest.approx(phi, abs=4 * math.sqrt((1 - phi**2) / N))
    assert stats.kstest(innovations, "norm").pvalue > 0.01
    assert abs(stats.pearsonr(innovations[1:], innovations[:-1]).statistic) < 3 / math.sqrt(N)


@steady
@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20), st.booleans())
def test_a_trace_repeats_in_order(recorded: list[float], spread: bool) -> None:
    """Message n has row (start + n) of the trace; without spread every link starts at the first row."""
    drawn = delays(channel(delay=Trace(delays_s=tuple(recorded), spread=spread)), 2 * len(recorded))

    starts = range(len(recorded)) if spread else (0,)
    turned = [recorded[start:] + recorded[:start] for start in starts]
    assert drawn[: len(recorded)] in turned
    assert drawn[: len(recorded)] == drawn[len(recorded) :]


@steady
@given(st.integers(0, 50), st.floats(0.05, 0.5))
def test_fifo_delays_never_let_a_message_overtake(seed: int, sigma: float) -> None:
    """With fifo, messages arrive in the order of sending, and no delay gets shorter; without it, some overtake."""
    model = Lognormal(median_s=0.1, sigma=2 * sigma)
    free = delays(channel(seed, delay=model), 200)
    kept = delays(channel(seed, delay=Lognormal(median_s=0.1, sigma=2 * sigma, fifo=True)), 200)
    arrivals = [seq * T_C + delay for seq, delay in enumerate(kept)]

    assert all(one <= other + 1e-12 for one, other in pairwise(arrivals))
    assert all(short <= long + 1e-12 for short, long in zip(free, kept, strict=True))


def test_a_change_of_the_delay_leaves_the_random_number_of_each_message() -> None:
    """Time decides the entry, and the message number decides the random number; neither affects the other."""
    whole = fates(channel(delay=Uniform(low_s=0.0, high_s=1.0)), range(100))
    late = fates(channel(delay=Uniform(low_s=0.0, high_s=1.0), from_s=1.0), range(100))

    assert late[:50] == [type(fate)(((0.0, None),)) for fate in late[:50]]
    assert late[50:] == whole[50:]
