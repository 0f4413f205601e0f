"""An intruder on a host of its own: ``python -m tests.security.intrude ENDPOINT KEYS NAME ATTACK``.

Prints "kept out" if the plant has answered a question that was asked after the attack, and the attack had no effect
that the intruder can see; "no access" if the plant never answered; else what came of it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import monotonic

from tests.security.intruder import Intruder, credentials
from wire.codec import RejectedError, decode
from wire.keys import Keys
from wire.messages import Answer, Command, Measurement, Message, State

RUN = "sites"
LONGEST = 6.0
"""Wait (s) for an answer: seen answers take 0.1 s."""


def lies(attack: str, keys: Keys) -> list[tuple[str, Message]]:
    """Return what an attack publishes."""
    if attack == "state":
        told = [State(sender="inv1", epoch=1, seq=10**6, t=1.0, P_set=1.0, V_set=277.0, Q=0.0, island="")]
        return [(keys.state("inv1"), lie) for lie in told]
    if attack == "measurement":
        lie = Measurement(
            sender="plant", epoch=1, seq=10**6, t=1.0, to="inv1", P=0.0, Q=0.0, V=0.0, f=0.0, P_set=0.0, V_set=0.0,
            grid_connected=False, island="",
        )  # fmt: skip
        return [(keys.measurement("inv1"), lie)]
    stop = Command(sender="visitor", epoch=0, seq=1, t=0.0, verb="down", reply_to="z1")
    return [(keys.command, stop)]


def main(endpoint: str, folder: str, name: str, attack: str) -> str:
    """Attack; return what came of it."""
    keys = Keys(RUN)
    with Intruder(endpoint, credentials(Path(folder), name)) as intruder:
        session = intruder.session
        answers = {keys.answer("z1"), keys.answer(session.id)}
        for key in answers:
            session.subscribe(key)
        question = Command(sender="visitor", epoch=0, seq=2, t=0.0, verb="status", reply_to=session.id)
        end = monotonic() + LONGEST
        while monotonic() < end:
            intruder.says(*lies(attack, keys), (keys.request, question))
            for _, key, payload, _ in session.take(1, 0.2):
                if key == keys.answer("z1"):
                    return "the command was answered"
                if key == keys.answer(session.id) and isinstance(_decoded(payload), Answer):
                    return "kept out"
    return "no access"


def _decoded(payload: bytes) -> Message | None:
    try:
        return decode(payload)
    except RejectedError:
        return None


if __name__ == "__main__":
    print(main(*sys.argv[1:]), flush=True)
