"""Runs in wall-clock time survive what a seeded schedule does to them; `many.py` carries out more of them by hand."""

from math import isfinite
from pathlib import Path

from tests.schedules.carry_out import carry_out
from tests.schedules.schedule import HEAL, draw

MICROGRIDS = {f"inv{i}": f"MG{(i + 2) // 3}" for i in range(1, 10)}


def test_a_seed_gives_one_schedule_and_every_fault_of_a_process_ends() -> None:
    """The same seed gives the same schedule; whoever is killed or frozen is back at the heal."""
    for seed in range(200):
        actions = draw(seed, MICROGRIDS)
        begun = sorted(action.subject for action in actions if action.kind in ("kill", "freeze"))
        ended = sorted(action.subject for action in actions if action.kind in ("start", "thaw"))

        assert actions == draw(seed, MICROGRIDS)
        assert begun == ended
        assert max(action.t for action in actions) == HEAL


def test_a_run_survives_a_schedule(tmp_path: Path) -> None:
    """Kills, freezes, link faults, switchings: the run goes on, no agent outlives it, islands with a leader come back.

    With this seed the plant found no solution after a switching and ended the run, before it could give up an island.
    """
    verdict = carry_out(6, tmp_path)

    assert verdict.broke == ""
    assert verdict.outlived == ()
    assert all(isfinite(f) for f in verdict.f_range)
    assert verdict.back, f"no island to look at: {verdict}"
    assert all(isfinite(t) for t in verdict.back.values()), verdict
