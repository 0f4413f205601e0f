"""The members of a run: the process that speaks for each name, its nameplate and its epoch. Pure.

A liveliness token, `alive/agent/<name>/<instance>`, identifies a process. Of two that claim one name the first
counts, until its token is gone; in simulated time the plant's roster may select another one. A node that sees a token
asks that process for its nameplate, once, and learns its epoch from the answer.
"""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.wire.admission import Admission
from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.codec import RejectedError
from gridpeers.wire.messages import Nameplate

MOST_PROCESSES = 8
"""Processes that may claim one name: two, while one replaces another, and some that are mistaken."""

ASKED_AT_ONCE = 20
"""Most processes that are asked for their nameplates again in one go: a question costs as much as ten messages."""


class Membership:
    """Tokens and nameplates of the agents.

    Parameters
    ----------
    admission : Admission
        Receives the epoch of each process that counts.

    Examples
    --------
    >>> members = Membership(Admission())
    >>> members.appeared("inv2", "a"), members.appeared("inv2", "b")
    (True, False)
    >>> list(members.unmet)
    [('inv2', 'a'), ('inv2', 'b')]
    >>> members.vanished("inv2", "a"), members.instance("inv2")
    (True, 'b')
    """

    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self._instances: dict[str, list[str]] = {}
        """Present processes of each name; the first one counts."""
        self._preferred: dict[str, str] = {}
        """Processes that count whenever their tokens are there, by name."""
        self._dismissed: dict[str, str] = {}
        """Processes that count no more although their tokens are there, by name."""
        self._answers: dict[tuple[str, str], Nameplate] = {}
        """Nameplate of each process that has answered."""
        self.nameplates: dict[str, Nameplate] = {}
        """Nameplates of the processes that count."""
        self.changes = 0
        """Number of changes so far of the processes that count, or of their nameplates."""
        self._asked = 0
        """Where among the processes without a nameplate the next ones to be asked again begin."""

    def has_room(self, name: str) -> bool:
        """Return whether one more token of a name is to be noted: anybody may hold tokens, each costs every node."""
        instances = self._instances.get(name)
        return len(self._instances) < MOST_INVERTERS if instances is None else len(instances) < MOST_PROCESSES

    def notes(self, name: str, instance: str) -> bool:
        """Return whether a process is noted, one that counts no more included; any thread may ask."""
        return instance in self._instances.get(name, ()) or self._dismissed.get(name) == instance

    def appeared(self, name: str, instance: str) -> bool:
        """Note a token; return whether its process counts."""
        instances = self._instances.setdefault(name, [])
        if instance not in instances:
            instances.append(instance)
            self._put_first(name)
            if instances[0] == instance != instances[-1]:  # it replaces another one
                self._update(name)
        return instances[0] == instance

    def vanished(self, name: str, instance: str) -> bool:
        """Note that a token is gone; return whether its process counted."""
        counted = self.instance(name) == instance
        instances = self._instances.get(name, [])
        if instance in instances:
            instances.remove(instance)
        if not instances:
            self._instances.pop(name, None)
        self._answers.pop((name, instance), None)
        if counted or self._dismissed.get(name) == instance:
            self._update(name)
        return counted

    def dismiss(self, name: str) -> None:
        """Let the process of a name count no more; its epoch stays valid until its token is gone or replaced."""
        self._dismissed[name] = self._instances[name].pop(0)
        self.nameplates.pop(name, None)
        self.changes += 1

    def prefer(self, name: str, instance: str) -> None:
        """Let one process of a name count as soon as its token is there."""
        self._preferred[name] = instance
        self._put_first(name)
        self._update(name)

    def instance(self, name: str) -> str:
        """Return the process that counts for a name; empty if there is none."""
        instances = self._instances.get(name)
        return instances[0] if instances else ""

    def meet(self, instance: str, nameplate: Nameplate) -> bool:
        """Take the answer of a process; return whether it is the first answer of a process that counts.

        Raises
        ------
        RejectedError
            If the process has no token, or its nameplate has changed.
        """
        name = nameplate.sender
        if instance not in self._instances.get(name, ()):
            raise RejectedError("ghost", f"the nameplate of {name}, whose token is gone")
        known = self._answers.setdefault((name, instance), nameplate)
        if known != nameplate:
            raise RejectedError("implausible", f"{name} has another nameplate than before; a nameplate never changes")
        if name in self.nameplates or instance != self.instance(name):
            return False
        self._update(name)
        return True

    @property
    def unmet(self) -> Iterator[tuple[str, str]]:
        """Name and instance of the processes that have not answered."""
        every = ((name, instance) for name, instances in self._instances.items() for instance in instances)
        return (process for process in every if process not in self._answers)

    def next_unmet(self) -> list[tuple[str, str]]:
        """Return the next of the processes that have not answered, to be asked again; all come in turn."""
        unmet = list(self.unmet)
        begin = self._asked if self._asked < len(unmet) else 0
        self._asked = begin + ASKED_AT_ONCE
        return unmet[begin : self._asked]

    def clear(self) -> None:
        """Forget all members."""
        self.changes += 1
        for name in self.nameplates:
            self._admission.release(name)
        for known in (self._instances, self._preferred, self._dismissed, self._answers, self.nameplates):
            known.clear()

    def _put_first(self, name: str) -> None:
        instances, preferred = self._instances.get(name, []), self._preferred.get(name)
        self.changes += 1
        if preferred in instances:
            instances.remove(preferred)
            instances.insert(0, preferred)

    def _update(self, name: str) -> None:
        """Set nameplate and epoch of a name to those of the process that counts."""
        self.changes += 1
        self._dismissed.pop(name, None)
        nameplate = self._answers.get((name, self.instance(name)))
        if nameplate is None:
            self.nameplates.pop(name, None)
            self._admission.release(name)
        else:
            self.nameplates[name] = nameplate
            self._admission.bind(name, nameplate.epoch)
