"""Who takes part: the process that speaks for each name, and which of its messages are valid. Pure.

- A liveliness token, `alive/agent/<name>/<instance>`, identifies a process. Of two of one name the first counts,
  until its token is gone; in simulated time the plant's roster may select another one.
- An *epoch* (`epoch` in messages) identifies one process: the plant's token contains it, and so does the nameplate of
  an agent's process. It is learnt once, and compared only for equality, so no host's clock decides who is believed.
- *Numbers* rise within an epoch.

A message is checked as it comes off the wire and, if an emulated link held it, again when the link delivers it. An
attacker who sends under another's name and epoch with its next number passes, without certificates.
"""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.wire.codec import RejectedError, RejectedMessages, decode
from gridpeers.wire.links import Links
from gridpeers.wire.messages import MOST_INVERTERS, AnyMessage, Measurement, Nameplate, State


class Admission:
    """The valid epoch of each name, and the last numbers of its messages."""

    def __init__(self) -> None:
        self.epochs: dict[str, int] = {}
        self._numbered: dict[str, int] = {}
        """Epoch of the numbers below; it outlasts a token that vanishes and reappears."""
        self._arrived: dict[str, int] = {}
        """Number of the last message off the wire."""
        self._passed: dict[str, int] = {}

    def bind(self, name: str, epoch: int) -> None:
        """Set the valid epoch of a name; in a new one the numbers start anew."""
        if self._numbered.get(name) != epoch:
            self._numbered[name] = epoch
            self._arrived.pop(name, None)
            self._passed.pop(name, None)
        self.epochs[name] = epoch

    def release(self, name: str) -> None:
        self.epochs.pop(name, None)

    def check(self, message: AnyMessage) -> None:
        """Raise RejectedError if a message is a ghost's, or its sender's epoch is not known (yet)."""
        name = message.sender
        if self.epochs.get(name) == message.epoch:
            return
        what = f"{type(message).__name__}({message.seq}) of epoch {message.epoch} of {name}"
        if name in self.epochs:
            raise RejectedError("ghost", f"{what}, whose epoch is {self.epochs[name]}")
        if self._numbered.get(name) == message.epoch:
            raise RejectedError("ghost", f"{what}, which is gone")
        raise RejectedError("unexpected", f"{what}, of which no process is known")

    def take(self, message: AnyMessage) -> int:
        """Note the number of a message off the wire; return how many are missing between it and the last.

        Raise RejectedError if a later message has arrived before.
        """
        name, seq = message.sender, message.seq
        last = self._arrived.get(name, seq - 1)
        if seq <= last:
            raise RejectedError("stale", f"{type(message).__name__}({seq}) of {name} after {last}")
        self._arrived[name] = seq
        return seq - last - 1

    def passes(self, message: AnyMessage) -> bool:
        name, seq = message.sender, message.seq
        if self.epochs.get(name) != message.epoch or seq <= self._passed.get(name, -1):
            return False
        self._passed[name] = seq
        return True

    def is_usable(self, links: Links | None, message: State | Measurement, payload: bytes, at: float) -> bool:
        """Return whether a message off the wire is of use at once; if not, `arrived` may yield it later.

        An emulated link takes the message if it came over one. The state of a paused agent only keeps the lock-step
        going: no link carries it, and no node uses it. `at` is the run time (s) on the receiver's clock.
        """
        name, seq = message.sender, message.seq
        if type(message) is State and message.idle:
            return False
        if links is not None and name not in links.clear and links.offer(message, payload, at):
            return False
        if self.epochs.get(name) != message.epoch or seq <= self._passed.get(name, -1):  # as `passes`, in one call
            return False
        self._passed[name] = seq
        return True

    def arrived(self, links: Links | None, now: float, rejects: RejectedMessages) -> Iterator[AnyMessage]:
        """Yield the messages that the links have let through by now (s of run time) and that are of use.

        A corrupted message is decoded again; its CRC-32 fails, so it is counted and dropped.
        """
        for arrival in () if links is None else links.due(now):
            message = arrival.message
            if message is None:
                try:
                    message = decode(arrival.payload)
                    if message.sender != arrival.src:
                        raise RejectedError("foreign", f"sender {message.sender}")
                except RejectedError as rejected:
                    rejects.add(rejected.kind, f"the link from {arrival.src}", rejected.text)
                    continue
            if self.passes(message):
                yield message


MOST_PROCESSES = 8  # Most processes that may claim one name: two while one replaces the other, and some by mistake

ASKED_AT_ONCE = 20
"""Most processes that are asked for their nameplates again in one go: a question costs as much as ten messages."""


class Membership:
    def __init__(self, admission: Admission) -> None:
        self._admission = admission
        self._instances: dict[str, list[str]] = {}
        self._preferred: dict[str, str] = {}
        self._dismissed: dict[str, str] = {}
        """Processes that count no more although their tokens are there, by name."""
        self._answers: dict[tuple[str, str], Nameplate] = {}
        self.nameplates: dict[str, Nameplate] = {}
        self.changes = 0
        """Number of changes so far of the processes that count, or of their nameplates."""
        self._asked = 0
        """Where among the processes without a nameplate the next ones to be asked again begin."""

    def has_room(self, name: str) -> bool:
        instances = self._instances.get(name)
        return len(self._instances) < MOST_INVERTERS if instances is None else len(instances) < MOST_PROCESSES

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
        """Stop counting the process of a name; its epoch stays valid until its token is gone or replaced."""
        self._dismissed[name] = self._instances[name].pop(0)
        self.nameplates.pop(name, None)
        self.changes += 1

    def prefer(self, name: str, instance: str) -> None:
        self._preferred[name] = instance
        self._put_first(name)
        self._update(name)

    def instance(self, name: str) -> str:
        """Return the process that counts for a name; empty if there is none."""
        instances = self._instances.get(name)
        return instances[0] if instances else ""

    def meet(self, instance: str, nameplate: Nameplate) -> bool:
        """Take the answer of a process; return whether it is the first answer of a process that counts.

        Raise RejectedError if the process has no token, or its nameplate has changed.
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

    def next_unmet(self) -> list[tuple[str, str]]:
        """Return the next of the processes that have not answered; all come in turn."""
        every = ((name, instance) for name, instances in self._instances.items() for instance in instances)
        unmet = [process for process in every if process not in self._answers]
        begin = self._asked if self._asked < len(unmet) else 0
        self._asked = begin + ASKED_AT_ONCE
        return unmet[begin : self._asked]

    def clear(self) -> None:
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
