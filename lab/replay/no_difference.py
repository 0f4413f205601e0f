"""A change that changed nothing, in words: people take eight zeros for a finding, and most often it is a slip."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.lab.replay.changes import ChangedRule
from gridpeers.scenarios.record.record_reader import RunRecord


def no_difference(record: RunRecord, rule: ChangedRule, until: float) -> str:
    """Return a sentence for changes under which every row up to a time (s) is as recorded, with reasons if known."""
    sentence = f"the change made no difference: every row up to {until:.2f} s is as recorded"
    return "; ".join([sentence, *_reasons(record, rule)])


def _reasons(record: RunRecord, rule: ChangedRule) -> Iterator[str]:
    changes = rule.changes
    if (changes.keys or changes.law) and rule.control is None and rule.links is None:
        yield "agents and links had these values already"
    if changes.without_loss and not any(of.dropped.get("loss") for of in record.link_counts().values()):
        yield "no message was lost by chance on an emulated link"
    commands = [request for request in record.link_requests() if request.link_command]
    if changes.without_link_commands:
        if not any(request.t >= changes.since for request in commands):
            yield "nobody commanded the links in that time"
    elif commands:
        first = min(request.t for request in commands)
        yield (
            f"link commands of people, the first from t = {first:.2f} s on, stay in force: --without-link-commands "
            "leaves them out"
        )
