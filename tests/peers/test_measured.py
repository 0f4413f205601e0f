"""Measuring in turns: what fails is left out with its reason, and everything else is measured."""

import subprocess
import sys

import pytest

from bench.harness import GRIDPEERS, checked, reason
from bench.peers.measured import Measure, measure_in_turns


def fails() -> dict[str, float]:
    """Fail as a rival does whose broker has died."""
    raise ValueError("no broker\nat line 3\nbroker.log: no room")


def test_a_rival_without_its_package_or_that_fails_is_left_out_and_named() -> None:
    """The others are measured all the same, in every round."""
    measures = [
        Measure("ours", lambda: {"ours": 2.0}),
        Measure("theirs", lambda: {"theirs": 1.0}, "no-such-rival"),
        Measure("broken", fails),
    ]

    part = measure_in_turns(lambda: measures, rounds=3)

    assert part.values == {"ours": [2.0] * 3}
    assert part.left_out["theirs"] == "no-such-rival is not installed: pip install 'gridpeers[bench]'"
    assert part.left_out["broken"] == "ValueError: no broker ... broker.log: no room"
    assert part.failed
    assert len(part.loads) == 4


def test_a_part_that_cannot_be_prepared_is_left_out_whole() -> None:
    """What the measures of a part share may fail before the first of them."""

    def measures() -> list[Measure]:
        checked([sys.executable, "-c", "import sys; sys.exit('no feeder\\nat all')"])
        return []

    part = measure_in_turns(measures, rounds=2)

    assert part.failed
    assert part.left_out["all of it"].endswith("ended with 1: at all")
    assert part.left_out["all of it"].startswith("`python -c")


def test_a_command_that_fails_is_named_as_a_person_types_it_with_its_last_line() -> None:
    """One line says which command, its exit status, and what it said last."""
    with pytest.raises(subprocess.CalledProcessError) as caught:
        checked([*GRIDPEERS, "run", "no-such-scenario"])

    line = reason(caught.value)

    assert line.startswith("`gridpeers run no-such-scenario` ended with 2: ")
    assert "\n" not in line
