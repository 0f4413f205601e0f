"""An intruder on a host of its own: ``python -m tests.security.intrude ENDPOINT RUN KEYS NAME ATTACK SECONDS``.

It asks the plant a question, attacks in the run's present epochs and time, and asks again. It prints "kept out" once
the second answer has come, which proves that the plant has had the attack's bytes before; "no access" if no answer
comes; "obeyed" if a command was answered.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import monotonic

from gridpeers.wire.codec import decode
from gridpeers.wire.keys import Keys, epoch_of
from gridpeers.wire.messages import Answer, Command, Measurement, Message, Nameplate, State
from tests.security.intruder import Intruder, credentials

LIE = 12345.0
"""Set-point (W) that no honest agent has."""


class Attacker:
    """What an intruder knows, and what it says."""

    def __init__(self, intruder: Intruder, run: str, longest: float) -> None:
        self._longest = longest
        """Wait (s) for an answer; those that come take 0.2 s on an idle machine."""
        self._session, self._intruder, self._keys = intruder.session, intruder, Keys(run)
        self._own, self._stolen = self._keys.answer(self._session.id), self._keys.answer("z1")
        self._epochs: dict[str, int] = {}
        self.obeyed = False
        for key in (self._own, self._stolen):
            self._session.subscribe(key)
        self._session.watch(self._keys.any_alive)

    def ask(self, lies: list[tuple[str, Message]]) -> Answer | None:
        """Say lies and ask for the plant's status, again and again; return its answer, None if none comes in time."""
        question = Command(sender="visitor", epoch=0, seq=2, t=0.0, verb="status", reply_to=self._session.id)
        end = monotonic() + self._longest
        while monotonic() < end:
            self._intruder.says(*lies, (self._keys.request, question))
            answer = None
            for kind, key, payload, _ in self._session.take(1, 0.2):
                if kind == "appeared":
                    self._note(key)
                elif kind == "message":
                    message = decode(payload)
                    if isinstance(message, Nameplate):
                        self._epochs[message.sender] = message.epoch
                    elif isinstance(message, Answer):
                        self.obeyed = self.obeyed or key == self._stolen
                        answer = message if key == self._own else answer
            if answer is not None:
                return answer
        return None

    def _note(self, token: str) -> None:
        match self._keys.parts(token):
            case ("alive", "plant", part):
                self._epochs["plant"] = epoch_of(part) or 0
            case ("alive", "agent", name, instance):
                self._session.fetch(self._keys.nameplate(name, instance))

    def lies(self, attack: str, t: float) -> list[tuple[str, Message]]:
        """Return what an attack publishes."""
        keys, number = self._keys, 10**6
        if attack == "state":
            epoch = self._epochs.get("inv1", 1)
            return [
                (
                    keys.state("inv1"),
                    State(sender="inv1", epoch=epoch, seq=number + k, t=t, P_set=LIE, V_set=2400.0, Q=0.0, island=""),
                )
                for k in range(60)
            ]
        if attack == "measurement":
            lie = Measurement(
                sender="plant", epoch=self._epochs.get("plant", 1), seq=number, t=t, to="inv1", P=LIE, Q=0.0, V=2400.0,
                f=60.0, P_set=LIE, V_set=2400.0, grid_connected=True, island="", roster=("inv1",),
            )  # fmt: skip
            return [(keys.measurement("inv1"), lie)]
        return [(keys.command, Command(sender="visitor", epoch=0, seq=1, t=0.0, verb="down", reply_to="z1"))]


def main(endpoint: str, run: str, folder: str, name: str, attack: str, longest: str) -> str:
    """Attack; return what came of it."""
    shown = None if folder == "-" else credentials(Path(folder), name)
    with Intruder(endpoint, shown) as intruder:
        attacker = Attacker(intruder, run, float(longest))
        known = attacker.ask([])
        answer = known
        for _ in range(2):
            answer = answer and attacker.ask(attacker.lies(attack, 0.0 if known is None else known.t))
        if known is None:
            intruder.says(*attacker.lies(attack, 0.0))
    return "obeyed" if attacker.obeyed else "no access" if answer is None else "kept out"


if __name__ == "__main__":
    print(main(*sys.argv[1:]), flush=True)
