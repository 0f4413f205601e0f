"""Delays as somebody measured them, one after the other."""

from __future__ import annotations

from netem.draws import Stream
from netem.models.delay.delay_model import DELAY, DelayModel, Sampler
from wire.table_schema import Problem

MOST_SHOWN = 5
"""So many wrong delays of a trace are named; a file in milliseconds has thousands."""


class Trace(DelayModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="trace"):
    """Message n has delay number (n + start) mod length of the trace.

    In a scenario `file` names a CSV file with a column `delay_s`; `netem.schema.trace_file` reads it into `delays_s`,
    so that an agent's configuration needs no file.
    """

    file: str = ""
    """Path of the CSV file, seen from the scenario's."""
    delays_s: tuple[float, ...] = ()
    """The delays (s), in the order of the messages."""
    spread: bool = True
    """Whether each link starts at a place of its own, drawn once; else all links have the same delay at once."""

    def sampler(self, stream: Stream) -> Sampler:
        """Draw where the link starts, once."""
        delays, start = self.delays_s, self.start(stream)
        return lambda seq: delays[(seq + start) % len(delays)]

    def start(self, stream: Stream) -> int:
        """Index of the delay that message 0 has."""
        return stream.below(len(self.delays_s), 0) if self.spread else 0

    def relations(self) -> list[Problem]:
        """Return the delays that cannot be meant, and whether there are none."""
        if not self.delays_s:
            return [] if self.file else [Problem("", 'a trace needs delays: write file = "delays.csv"')]
        wrong = [
            Problem(f"delays_s[{i}]", text)
            for i, delay_s in enumerate(self.delays_s)
            if (text := DELAY.objection(delay_s, "s"))
        ]
        more = len(wrong) - MOST_SHOWN
        return wrong[:MOST_SHOWN] + ([Problem("delays_s", f"{more} more like these")] if more > 0 else [])
