"""The self-check: quiet about a sound run, loud about every kind of wrong one."""

from __future__ import annotations

from typing import Any

import pytest
from scipy import stats

from netem.check.verify import Report, verify
from netem.ledger import LinkTrace
from netem.models.copies import Corrupt, Duplicate
from netem.models.delay import Constant, Lognormal, Normal, Trace, Uniform
from netem.models.gates import Cut, Flap
from netem.models.loss import GilbertElliott, Markov
from netem.receiver import Receiver
from netem.schema.change import Heal
from netem.schema.fault import Fault
from netem.schema.netem import Netem
from netem.schema.pattern import Link
from tests.unit.netem.link_messages import MICROGRIDS, T_C

LINK = Link("inv1", "inv2")


def traced(fault: dict[str, Any], n: int = 2000, seed: int = 1, *more: Fault) -> tuple[LinkTrace, ...]:
    """Verdicts of n messages on one link."""
    to = Receiver("inv2", Netem(seed=seed, links=(Fault(on="inv1 -> inv2", **fault), *more)), MICROGRIDS)
    for k in range(n):
        to.offer("inv1", k, k * T_C, k * T_C, bytes(100))
    return to.take_trace()


def held_against(traces: tuple[LinkTrace, ...], told: dict[str, Any], seed: int = 1) -> Report:
    """Check of the verdicts against a link's law, or without one."""
    return verify(traces, {LINK: Fault(on="inv1 -> inv2", **told).spans(*LINK, MICROGRIDS)}, seed)


SOUND: dict[str, dict[str, Any]] = {
    "constant": {"delay": 0.1},
    "uniform": {"delay": Uniform(low_s=0.01, high_s=0.05)},
    "normal": {"delay": Normal(mean_s=0.05, std_s=0.01)},
    "correlated": {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.8)},
    "trace": {"delay": Trace(delays_s=(0.1, 0.2, 0.05))},
    "bernoulli": {"loss": 0.1},
    "gilbert": {"loss": GilbertElliott(p=0.05, r=0.3)},
    "gilbert-elliott": {"loss": GilbertElliott(p=0.05, r=0.3, loss_good=0.02, loss_bad=0.7)},
    "markov": {"loss": Markov(p13=0.05, p31=0.3, p32=0.2, p23=0.5, p14=0.03)},
    "duplicate": {"duplicate": 0.1},
    "corrupt": {"corrupt": 0.1},
    "cut": {"cut": True},
}

WRONG: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "constant": (SOUND["constant"], {"delay": 0.101}, "delay"),
    "uniform": (SOUND["uniform"], {"delay": Uniform(low_s=0.01, high_s=0.055)}, "delay"),
    "normal": (SOUND["normal"], {"delay": Normal(mean_s=0.05, std_s=0.012)}, "delay"),
    "correlated, marginal": (
        SOUND["correlated"],
        {"delay": Lognormal(median_s=0.025, sigma=0.5, correlation=0.8)},
        "delay",
    ),
    "correlation": (
        SOUND["correlated"],
        {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.7)},
        "delay correlation",
    ),
    "trace": (SOUND["trace"], {"delay": Trace(delays_s=(0.1, 0.05, 0.2))}, "delay"),
    "bernoulli": (SOUND["bernoulli"], {"loss": 0.13}, "loss"),
    "bursts": ({"loss": 0.25}, {"loss": GilbertElliott(p=0.1, r=0.3)}, "bursts"),
    "gilbert": (SOUND["gilbert"], {"loss": GilbertElliott(p=0.1, r=0.3)}, "loss"),
    "duplicate": (SOUND["duplicate"], {"duplicate": 0.14}, "duplicate"),
    "corrupt": (SOUND["corrupt"], {"corrupt": 0.14}, "corrupt"),
    "cut": (SOUND["constant"], {"cut": True}, "cut"),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_link_that_does_as_told_passes(name: str) -> None:
    """Every model's own verdicts pass its own check, in which something was tested."""
    report = held_against(traced(SOUND[name]), SOUND[name])

    assert not report.warnings
    assert report.rows
    assert all(row.ok for row in report.rows)


@pytest.mark.parametrize("name", WRONG)
def test_a_link_that_does_otherwise_is_noticed(name: str) -> None:
    """Held against parameters a little off, verdicts fail the test that is about them, with link and both values."""
    done, told, what = WRONG[name]
    report = held_against(traced(done), told)

    assert what in {row.what for row in report.rows if row.ok is False}
    assert any(warning.startswith(f"inv1 -> inv2: {what} is ") for warning in report.warnings)


@pytest.mark.parametrize("name", ["bernoulli", "gilbert", "gilbert-elliott", "markov", "normal", "correlated"])
def test_what_a_test_calls_improbable_is_as_rare_as_it_says(name: str) -> None:
    """Over 40 seeds the p-values of sound links are spread over (0, 1): no test cries wolf, and none sleeps."""
    values: dict[str, list[float]] = {}
    for seed in range(40):
        for row in held_against(traced(SOUND[name], 1600, seed), SOUND[name], seed).rows:
            assert row.p is not None
            values.setdefault(row.what, []).append(row.p)

    assert {len(found) for found in values.values()} == {40}
    assert all(stats.kstest(found, "uniform").pvalue > 0.001 for found in values.values())


def test_what_cannot_be_tested_says_why() -> None:
    """Too few messages, and delays under a flap that holds, are rows with a reason and no verdict."""
    few = held_against(traced({"loss": 0.1, "duplicate": 0.1}, 20), {"loss": 0.1, "duplicate": 0.1})
    masked = {"delay": 0.1, "flap": Flap(up_s=1.0, down_s=1.0, hold=True)}

    assert {row.realised for row in few.rows} == {
        "too few messages to tell: 20",
        f"too few messages to tell: {few.rows[1].n}",
    }
    assert {row.what: row.ok for row in held_against(traced(masked), masked).rows} == {"flap": None, "delay": None}
    assert any("a flap that holds" in row.realised for row in held_against(traced(masked), masked).rows)


def test_loss_is_judged_by_what_met_it() -> None:
    """Messages that a cut dropped before are left out, and the rest still passes."""
    cut = Fault(on="inv1 -> inv2", cut=True, from_s=10.0, to_s=20.0)
    report = held_against(traced({"loss": 0.1}, 2000, 1, cut), {"loss": 0.1})

    assert [(row.n, row.ok) for row in report.rows] == [(1500, True)]


def test_each_entry_is_held_against_its_own_time() -> None:
    """Two losses one after the other are two tests, and live changes are checked through the flat schedule."""
    first, second = Fault(on="* -> inv2", loss=0.5, to_s=20.0), Fault(on="* -> inv2", loss=0.05, from_s=20.0)
    netem = Netem(links=(first, second))
    traces = traced({"loss": 0.5, "to_s": 20.0}, 2000, 1, second)
    report = verify(traces, {LINK: netem.spans(LINK, MICROGRIDS)}, 1)

    assert [(row.configured, row.n, row.ok) for row in report.rows] == [("0.5", 1000, True), ("0.05", 1000, True)]


def test_many_links_together_do_not_raise_a_false_alarm() -> None:
    """Links to three inverters, with everything on them, are over a hundred tests and no warning (Holm)."""
    fault = Fault(
        on="* <-> *",
        delay=Normal(mean_s=0.05, std_s=0.01),
        loss=GilbertElliott(p=0.1, r=0.4),
        duplicate=Duplicate(p=0.1),
        corrupt=Corrupt(p=0.05, checksum=True),
    )
    netem, traces, counts = Netem(links=(fault,)), [], {}
    for dst in ("inv1", "inv5", "inv9"):
        to = Receiver(dst, netem, MICROGRIDS)
        for k in range(400):
            for src in MICROGRIDS:
                if src != dst:
                    to.offer(src, k, k * T_C, k * T_C, bytes(100))
            to.due(k * T_C)
        traces += to.take_trace()
        counts |= {Link(src, dst): count for src, count in to.counts().items()}
    report = verify(traces, {link: netem.spans(link, MICROGRIDS) for link in counts}, 1)

    assert len(counts) == 24
    assert all(count.closes for count in counts.values())
    assert sum(row.ok is True for row in report.rows) >= 24 * 4
    assert not report.warnings


def test_of_a_message_judged_twice_the_last_verdict_counts() -> None:
    """A message that a healed cut let go is in the check once, with the delay it had in the end."""
    to = Receiver("inv2", Netem(links=(Fault(on="* -> inv2", delay=Constant(delay_s=0.1)),)), MICROGRIDS)
    to.apply(Fault(on="* -> inv2", cut=Cut(hold=True)))
    to.offer("inv1", 0, 0.0, 0.0, b"x")
    to.apply(Heal(on="* -> inv2", from_s=0.0, kinds=("cut",)))
    (row,) = held_against(to.take_trace(), {"delay": 0.1}).rows

    assert (row.n, row.ok) == (1, True)
