"""The phases of a node: a table of all transitions, and the phase that events lead to. Pure."""

from __future__ import annotations

from collections.abc import Mapping

PhaseTable = Mapping[str, Mapping[str, str]]
"""For each phase the events that may happen in it, and the phase that each leads to. The first phase is the start."""


class PhaseError(RuntimeError):
    """An event that must not happen in a phase: an error of the node, not of its peers."""


class Phases:
    """The phase of a node; nothing but an event of the table changes it."""

    def __init__(self, table: PhaseTable) -> None:
        self._table = table
        self.now = next(iter(table))

    def allows(self, event: str) -> bool:
        return event in self._table[self.now]

    def on(self, event: str) -> None:
        if event not in self._table[self.now]:
            events = ", ".join(self._table[self.now]) or "none"
            raise PhaseError(f'no event "{event}" may happen in phase "{self.now}"; events of this phase: {events}')
        self.now = self._table[self.now][event]


def diagram(table: PhaseTable) -> str:
    """Return the table as a state diagram of Mermaid."""
    arrows: dict[tuple[str, str], list[str]] = {}
    for phase, events in table.items():
        for event, after in events.items():
            arrows.setdefault((phase, after), []).append(event)
    lines = [f"    {phase} --> {after}: {', '.join(events)}" for (phase, after), events in arrows.items()]
    last = [f"    {phase} --> [*]" for phase, events in table.items() if not events]
    return "\n".join(["stateDiagram-v2", f"    [*] --> {next(iter(table))}", *lines, *last])
