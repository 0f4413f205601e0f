"""The check `link_laws`: quiet about a sound run, loud about every kind of wrong one."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from gridpeers.lab.link_laws import LinkLaws, LinkTest, blocks_of, improbable, law, link_tests
from gridpeers.netem.draws import RESTART
from gridpeers.netem.ledger import LinkTrace
from gridpeers.netem.models.delay import Lognormal, Normal, Pareto, Trace, Uniform
from gridpeers.netem.models.loss import GilbertElliott, Markov
from gridpeers.netem.models.medium import Flap
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import PROFILES, Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link
from gridpeers.scenarios.checks.check_registry import CHECKS
from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.wire.plugins.plugin import Plugin
from tests.record.recorded_runs import recorded_run
from tests.unit.netem.link_messages import MICROGRIDS, T_C
from tests.unit.netem.test_loss import PATTERNS, probability

LINK = Link("inv1", "inv2")
LEVEL = 0.001

SOUND: dict[str, dict[str, Any]] = {
    "constant": {"delay": 0.1},
    "uniform": {"delay": Uniform(low_s=0.01, high_s=0.05)},
    "normal": {"delay": Normal(mean_s=0.05, std_s=0.04)},
    "pareto": {"delay": Pareto(minimum_s=0.01, shape=1.5)},
    "correlated": {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.8)},
    "trace": {"delay": Trace(delays_s=(0.1, 0.2, 0.05))},
    "bernoulli": {"loss": 0.1},
    "gilbert": {"loss": GilbertElliott(p=0.05, r=0.3)},
    "long bursts": {"loss": GilbertElliott(p=0.005, r=0.02)},
    "gilbert-elliott": {"loss": GilbertElliott(p=0.05, r=0.3, loss_good=0.02, loss_bad=0.7)},
    "markov": {"loss": Markov(p13=0.05, p31=0.3, p32=0.2, p23=0.5, p14=0.03)},
    "loss and flap": {"loss": GilbertElliott(p=0.02, r=0.2), "flap": Flap(up_s=0.7, down_s=0.3)},
    "duplicate": {"duplicate": 0.1},
    "corrupt": {"corrupt": 0.1, "duplicate": 0.3},
    "cut": {"cut": True},
}

WRONG: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "constant": (SOUND["constant"], {"delay": 0.101}, "delay"),
    "uniform": (SOUND["uniform"], {"delay": Uniform(low_s=0.01, high_s=0.055)}, "delay"),
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
    "bernoulli": (SOUND["bernoulli"], {"loss": 0.14}, "loss"),
    "bursts": ({"loss": 0.25}, {"loss": GilbertElliott(p=0.1, r=0.3)}, "bursts"),
    "gilbert": (SOUND["gilbert"], {"loss": GilbertElliott(p=0.1, r=0.3)}, "loss"),
    "duplicate": (SOUND["duplicate"], {"duplicate": 0.14}, "duplicate"),
    "corrupt": ({"corrupt": 0.1}, {"corrupt": 0.14}, "corrupt"),
    "cut": (SOUND["constant"], {"cut": True}, "cut"),
}


def traced(done: dict[str, Any], n: int = 2000, seed: int = 1, links: Iterable[Link] = (LINK,)) -> list[LinkTrace]:
    """Verdicts of n messages on each link."""
    found: list[LinkTrace] = []
    for link in links:
        to = Receiver(link.dst, Netem(seed=seed, links=(Fault(on="* <-> *", **done),)), MICROGRIDS)
        for k in range(n):
            to.offer(link.src, k, k * T_C, k * T_C, bytes(100))
        found += to.take_trace()
    return found


def held_against(traces: Iterable[LinkTrace], told: dict[str, Any], seed: int = 1) -> list[LinkTest]:
    """Tests of the verdicts against what the links were told."""
    return link_tests(traces, Netem(seed=seed, links=(Fault(on="* <-> *", **told),)), MICROGRIDS)


@pytest.mark.parametrize("name", SOUND)
def test_a_link_that_does_as_told_passes(name: str) -> None:
    """Every model's own verdicts pass its own check, in which something was tested."""
    found = held_against(traced(SOUND[name]), SOUND[name])

    assert [test for test in found if test.p is not None]
    assert improbable(found, LEVEL) == []


@pytest.mark.parametrize("name", WRONG)
def test_a_link_that_does_otherwise_is_noticed(name: str) -> None:
    """Held against parameters a little off, verdicts fail the test that is about them."""
    done, told, what = WRONG[name]

    assert what in {test.what for test in improbable(held_against(traced(done), told), LEVEL)}


def test_sound_runs_of_any_kind_and_length_fail_no_more_often_than_promised() -> None:
    """Of some 250 runs at most as many are below any level as the level says (Holm), also where bursts are rare."""
    kinds = SOUND | {name: {"profile": name} for name in PROFILES}
    first = []
    for i, done in enumerate(kinds.values()):
        for n, runs in ((5, 4), (60, 8), (450, 2)):
            for seed in range(1000 * i, 1000 * i + runs):
                values = [test.p for test in held_against(traced(done, n, seed), done, seed) if test.p is not None]
                first += [min(1.0, len(values) * min(values))] if values else []

    for level in (0.001, 0.01, 0.05, 0.2):
        assert stats.binomtest(sum(p <= level for p in first), len(first), level, "greater").pvalue > 0.001


def test_one_falsified_link_of_72_is_the_only_one_that_is_named() -> None:
    """Holm's method leaves enough to find a link that loses a fifth where a tenth was told."""
    told, done = ({"loss": GilbertElliott(p=p, r=0.5)} for p in (0.05, 0.125))
    links = {Link(src, dst) for dst in MICROGRIDS for src in MICROGRIDS if src != dst} - {LINK}
    found = held_against([*traced(told, 450, 3, sorted(links)), *traced(done, 450, 3)], told, 3)

    assert {test.link for test in improbable(found, LEVEL)} == {LINK}


@pytest.mark.parametrize("name", ["gilbert", "gilbert-elliott", "markov"])
def test_the_law_of_a_count_is_the_sum_over_all_patterns(name: str) -> None:
    """Losses and bursts have the probabilities that all patterns of eight messages, with gaps, add up to."""
    seq = np.array([RESTART - 6, RESTART - 5, RESTART - 4, RESTART - 1, RESTART, RESTART + 1, RESTART + 2, RESTART + 4])
    follows = (np.diff(seq) == 1) & (seq[1:] % RESTART != 0)
    losses, bursts = np.zeros(len(seq) + 1), np.zeros(len(seq) + 1)
    for pattern in product((False, True), repeat=len(seq)):
        lost, share = np.array(pattern), probability(PATTERNS[name], seq, pattern)
        losses[lost.sum()] += share
        bursts[(~lost[:-1] & lost[1:] & follows).sum()] += share

    assert law(PATTERNS[name], blocks_of(seq)) == pytest.approx(losses, abs=1e-13)
    assert law(PATTERNS[name], blocks_of(seq), bursts=True) == pytest.approx(bursts, abs=1e-13)


def test_loss_is_judged_by_what_met_it_in_its_time() -> None:
    """Messages that a cut dropped are left out; two losses one after the other are two tests."""
    netem = Netem(
        links=(
            Fault(on="inv1 -> inv2", loss=0.5, to_s=20.0),
            Fault(on="inv1 -> inv2", loss=0.05, from_s=20.0),
            Fault(on="inv1 -> inv2", cut=True, from_s=10.0, to_s=15.0),
        )
    )
    to = Receiver("inv2", netem, MICROGRIDS)
    for k in range(2000):
        to.offer("inv1", k, k * T_C, k * T_C, bytes(100))
    found = link_tests(to.take_trace(), netem, MICROGRIDS)

    assert [(test.what, test.configured, test.n) for test in found] == [
        ("loss", "0.5", 750),
        ("loss", "0.05", 1000),
        ("cut", "nothing passes", 250),
    ]
    assert improbable(found, LEVEL) == []


# ---------------------------------------------------------------- a fault of a user

OWN = """
import gridpeers as gp


class Jam(gp.LinkFault):
    def judge(self, message, draws):
        return None if draws.uniform() < 0.4 else 0.01


class Counts(gp.LinkFault):
    seen = 0

    def judge(self, message, draws):
        Counts.seen += 1
        return 0.001 * Counts.seen


class Sized(gp.LinkFault):
    def judge(self, message, draws):
        return message.size * 1e-6
"""


@pytest.mark.parametrize(
    ("names", "said", "p"),
    [
        (("Jam",), "otherwise for 0", 1.0),
        (("Counts",), "otherwise for 200", 0.0),
        (("Sized",), "not tested: it fails, or needs the size", None),
        (("Jam", "Sized"), "not tested: lab_faults:Sized on it", None),
    ],
)
def test_a_fault_of_a_user_must_say_what_it_said(
    names: tuple[str, ...], said: str, p: float | None, tmp_path: Path
) -> None:
    """It is asked again about each message: what no other run would repeat is found."""
    (tmp_path / "lab_faults.py").write_text(OWN)
    told = {"own": tuple(Plugin(use=f"lab_faults:{name}", folder=str(tmp_path)) for name in names)}
    found = held_against(traced(told, 200), told)[0]

    assert found.realised.startswith(said)
    assert found.p == p


# ---------------------------------------------------------------- in a run


TEXT = """
[time]
end_s = 1.0
[case.lossy]
secondary = "all"
graph = "ring"
[[case.lossy.link]]
on = "inv1 <-> inv2"
loss = 0.2
delay = 0.02
[case.calm]
secondary = "none"
graph = "none"
"""


def test_it_is_found_by_name_and_judges_a_run_by_its_record(tmp_path: Path) -> None:
    """A scenario says `checks = ["link_laws"]`; without emulated links there is nothing to judge."""
    check = CHECKS.resolve("link_laws")()
    (tmp_path / "mine.toml").write_text(TEXT)
    cases: dict[str, Any] = {}
    for name in ("lossy", "calm"):
        recorded_run(tmp_path / "mine.toml", name, tmp_path / name)
        cases[name] = SimpleNamespace(communication=None, folder=tmp_path / name)

    assert isinstance(check, LinkLaws)
    assert list(check(cases["lossy"])) == []
    with pytest.raises(NotJudgedError, match="the run has no emulated links"):
        list(check(cases["calm"]))
