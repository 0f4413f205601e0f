"""The paper's law as a program, with failures on demand: `python consensus_program.py [FAILURE]`."""

from __future__ import annotations

import json
import sys
from time import sleep

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.law import Neighbour, Own

FAILURES = {
    "rubbish": "hello",
    "error": '{"error": "no idea"}',
}
"""What is answered instead of a decision."""


def main(failure: str) -> None:
    """Answer each line of standard input, and fail from the tenth step on."""
    law, steps = Consensus(), 0
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["type"] == "start":
            law = Consensus(**asked["parameters"])
            print(json.dumps({"type": "ready"}), flush=True)
            continue
        steps += 1
        if failure and steps == 10:
            if failure == "dies":
                sys.exit(7)
            if failure == "hangs":
                sleep(600.0)
            if failure == "babbles":  # answers without end to lines that it does not read
                while True:
                    print('{"P_set": 0.5, "V_set": 1.0}')
            print(FAILURES[failure], flush=True)
            continue
        around = [Neighbour(**other) for other in asked["neighbours"]]
        decision = law.step(Own(**asked["own"]), around, asked["T"])
        print(json.dumps({"P_set": decision.P_set, "V_set": decision.V_set}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")
