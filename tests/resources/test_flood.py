"""Floods in a run of real processes: bounded memory and log, control goes on, and every loss is counted.

``python -m tests.resources`` does the same for longer, on the paper's feeder, and prints what docs/reliability.md has.
"""

from __future__ import annotations

from pathlib import Path

from gridpeers.wire.driver.session import Session
from gridpeers.wire.messages import LONGEST_MESSAGE
from tests.resources.trial import Trial, Watch, attack_on, attacking
from tests.toy.town import Town

TWO = ("inv1", "inv2")


def _somebody(town: Town) -> Session:
    return Session("someone", listen=("tcp/127.0.0.1:0",), connect=(town.endpoint,), clock="wall")


def test_floods_of_strangers_are_counted_and_control_goes_on(tmp_path: Path) -> None:
    """States, measurements, stops, questions, tokens, long messages of somebody: the run goes on, and says how many."""
    with Town(2, tmp_path).all() as town:
        found: dict[str, Trial] = {}
        watch = Watch(town)
        with attacking(attack_on(town, "commands", 10_000.0), tmp_path):  # first: a log names the first of each kind
            unanswered = (town.keys.request, "excess")
            town.until(lambda: unanswered in watch.drops(), "the plant says that it answers no more")
            watch.run_on(0.5)
        found["commands"] = watch.result(town.rows[watch.first_row :])
        watch = Watch(town)
        with attacking(attack_on(town, "foreign", 10_000.0), tmp_path):
            town.until(lambda: watch.rejected() > 3_000, "thousands are counted")
            town.until(lambda: abs(town.rows[-1][1] - 60.0) < 0.005, "the frequency is restored meanwhile")
        found["foreign"] = watch.result(town.rows[watch.first_row :])
        watch = Watch(town)
        with attacking(attack_on(town, "tokens", 0.0, tokens=400), tmp_path):
            town.until(lambda: watch.rejected() > 400, "the plant and the agents have counted them")
            watch.run_on(0.5)
        found["tokens"] = watch.result(town.rows[watch.first_row :])
        watch = Watch(town)
        someone, tries = _somebody(town), 0

        def counted() -> bool:
            """Whether long messages were counted and logged; a new session replaces one that Zenoh has broken."""
            nonlocal someone, tries
            tries += 1
            if tries % 100 == 0:
                someone.close()
                someone = _somebody(town)
            for name in TWO:
                someone.publish(town.keys.state(name), bytes(LONGEST_MESSAGE + 1))
            return watch.rejected() >= 2 and "oversized" in {kind for _, kind in watch.drops()}

        try:
            town.until(counted, "the long ones are counted and told")
            watch.run_on(0.5)
        finally:
            someone.close()
        found["long"] = watch.result(town.rows[watch.first_row :])
        town.together(TWO)

        assert found["commands"].rejected > 0
        assert "corrupt" in found["foreign"].kinds
        assert "excess" in found["tokens"].kinds
        assert "oversized" in found["long"].kinds
        for kind, trial in found.items():
            assert trial.rows > 0, kind
            assert trial.growth < 2.0, (kind, trial.memory)
            assert trial.log < 50_000, kind  # a line for each message would be ten times as long
        assert [child.status for child in town.children] == [None] * 3
