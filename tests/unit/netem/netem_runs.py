"""Whole runs of netem alone, sound or falsified, and what the self-check says of them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Any

from netem.check.verify import LEVEL, Report, verify
from netem.ledger import LinkTrace
from netem.models.copies import Corrupt, Duplicate
from netem.models.delay import Constant, Lognormal, Normal, Pareto, Trace, Uniform
from netem.models.gates import Flap
from netem.models.loss import GilbertElliott, Markov
from netem.models.medium import Rate, Slots
from netem.receiver import Receiver
from netem.schema.fault import Fault
from netem.schema.netem import Netem
from netem.schema.pattern import Link
from netem.schema.profiles import PROFILES
from tests.unit.netem.link_messages import MICROGRIDS, T_C

KINDS: dict[str, dict[str, Any]] = {
    "uniform": {"delay": Uniform(low_s=0.01, high_s=0.05)},
    "normal": {"delay": Normal(mean_s=0.05, std_s=0.04)},
    "pareto": {"delay": Pareto(minimum_s=0.01, shape=1.5)},
    "correlated": {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.95)},
    "trace": {"delay": Trace(delays_s=(0.1, 0.2, 0.05))},
    "bernoulli": {"loss": 0.1},
    "rare": {"loss": 0.001},
    "gilbert": {"loss": GilbertElliott(p=0.05, r=0.3)},
    "rare bursts": {"loss": GilbertElliott(p=0.0005, r=0.25)},
    "long bursts": {"loss": GilbertElliott(p=0.005, r=0.02)},
    "gilbert-elliott": {"loss": GilbertElliott(p=0.05, r=0.3, loss_good=0.02, loss_bad=0.7)},
    "markov": {"loss": Markov(p13=0.01, p31=0.2, p32=0.3, p23=0.4, p14=0.02)},
    "loss and flap": {"loss": GilbertElliott(p=0.02, r=0.2), "flap": Flap(up_s=0.7, down_s=0.3)},
    "loss, rate, slots": {
        "loss": GilbertElliott(p=0.02, r=0.2),
        "rate": Rate(bytes_per_s=6000.0),
        "slots": Slots(period_s=0.1, length_s=0.05),
        "delay": Constant(delay_s=0.01),
    },
    "duplicate": {"duplicate": Duplicate(p=0.02)},
    "corrupt": {"corrupt": Corrupt(p=0.02), "duplicate": 0.3},
    "cut": {"cut": True},
}
"""What a link may do, at the ends where a law is far from normal; with all profiles, all faults there are."""

ALL = KINDS | {name: {"profile": name} for name in PROFILES}


def all_links() -> tuple[Link, ...]:
    """Links between nine agents: 72."""
    return tuple(Link(src, dst) for dst in MICROGRIDS for src in MICROGRIDS if src != dst)


def traced(done: dict[str, Any], n: int, seed: int, links: Iterable[Link]) -> list[LinkTrace]:
    """Have links do something to n messages each."""
    netem, found = Netem(seed=seed, links=(Fault(on="* <-> *", **done),)), []
    for dst, into in groupby(sorted(links, key=lambda link: link.dst), key=lambda link: link.dst):
        to = Receiver(dst, netem, MICROGRIDS)
        for src, _ in into:
            for k in range(n):
                to.offer(src, k, k * T_C, k * T_C, bytes(100))
        found += to.take_trace()
    return found


def checked(traces: Iterable[LinkTrace], told: dict[str, Any], seed: int) -> Report:
    """Hold links against what they were told."""
    traces, fault = list(traces), Fault(on="* <-> *", **told)
    links = [Link(trace.src, trace.dst) for trace in traces]
    return verify(traces, {link: fault.spans(*link, MICROGRIDS) for link in links}, seed)


def sound(done: dict[str, Any], n: int, seed: int, links: Iterable[Link] = (Link("inv1", "inv2"),)) -> Report:
    """Check a run in which every link does as it was told."""
    return checked(traced(done, n, seed, links), done, seed)


def family(found: Report) -> float:
    """Level at which a run would have had its first warning (Holm): at most a is as rare as a in sound runs."""
    tested = [row.p for row in found.rows if row.p is not None]
    return min(1.0, len(tested) * min(tested)) if tested else 1.0


def warned(found: Report) -> bool:
    """Whether a run has a warning, which at most a share `LEVEL` of the sound ones may have."""
    assert bool(found.warnings) == (family(found) <= LEVEL)
    return bool(found.warnings)
