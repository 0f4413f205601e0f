"""The self-check of a run's emulated links: what they did beside what the scenario says. Imports scipy.stats: slow."""

from __future__ import annotations

from netem.check.verify import Report, verify
from netem.schema.pattern import Link
from scenarios.emulation.emulation_config import EmulationConfig
from scenarios.results.link_records import LinkRecord
from wire.messages import PLANT


def self_check(record: LinkRecord, setup: EmulationConfig) -> Report:
    """Test every link of a case over which anything was sent; see `netem.check.verify`.

    Parameters
    ----------
    record : LinkRecord
        The verdicts and counts of all links.
    setup : EmulationConfig
        The faults that the case configures.
    """
    names = (*setup.microgrids, PLANT)
    links = [Link(src, dst) for src in names for dst in names if (src, dst) in record.counts]
    spans = {link: spans for link in links if (spans := setup.netem.spans(link, setup.microgrids))}
    return verify(record.traces, spans, setup.netem.seed)
