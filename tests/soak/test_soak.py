"""The limits of a soak on made-up measurements: what grows, is late without a reason, or heals slowly fails."""

from __future__ import annotations

import sys
from itertools import islice
from math import inf, isinf
from pathlib import Path

import pytest
from msgspec.structs import replace

import gridpeers as gp
from bench.soak.judging import Finding, ProcessSize, growths, judge_checks, judge_growth, judge_late, judge_times
from bench.soak.soak_actions import DECK, SoakAction, soak_actions
from bench.soak.soak_monitor import SoakMonitor
from bench.soak.soak_run import SoakRun
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, Violation
from gridpeers.wire.messages import AgentStatus, Telemetry
from tests.hostile.cases import sound_message
from tests.toy.toy_configs import agent_config

AGENTS = tuple(f"inv{i}" for i in range(1, 10))

HOUR = 3600.0


def drawn(seed: int, count: int) -> list[SoakAction]:
    return list(islice(soak_actions(seed, AGENTS[2:], AGENTS, "inv10", ("MG1", "MG2", "MG3")), count))


def looks(growth: float) -> list[ProcessSize]:
    """An hour of a plant that grows by a part over it, and of an agent that is restarted every two minutes."""
    found = []
    for k in range(720):
        at = 5.0 * k
        found.append(ProcessSize(at, "plant", 1, 0.0, 100.0 * (1.0 + growth * at / HOUR), 30))
        birth = at // 120.0
        found.append(ProcessSize(at, "inv3", int(birth) + 2, 120.0 * birth + 0.1, 40.0, 20))
    return found


def status(name: str, *used: str) -> AgentStatus:
    """A status with these neighbours in the agent's sums."""
    return sound_message(AgentStatus, sender=name, neighbours=used, ages=(0.0,) * len(used), used=used)


def test_a_seed_decides_all_actions_and_a_deal_has_every_kind() -> None:
    """The same seed gives the same ones, another others; agents that stay are neither replaced nor frozen."""
    deal = drawn(1, len(DECK))

    assert deal == drawn(1, len(DECK))
    assert deal != drawn(2, len(DECK))
    assert sorted(one.kind for one in deal) == sorted(DECK)
    replaced = [one.agents[0] for one in drawn(1, 10 * len(DECK)) if one.kind in ("leave", "kill", "freeze")]
    assert set(replaced[:7]) == set(AGENTS[2:])
    assert not {"inv1", "inv2"} & set(replaced)


@pytest.mark.parametrize(("growth", "verdict"), [(0.04, "PASS"), (0.12, "FAIL"), (-0.3, "PASS")])
def test_memory_that_grows_by_more_than_a_twentieth_fails(growth: float, verdict: str) -> None:
    """Measured from the warm-up to the end, for the process that grows; a run of minutes is not judged."""
    found = growths(looks(growth), "memory", ["plant"])

    assert judge_growth("memory", found, HOUR).verdict == verdict
    assert judge_growth("memory", found, 60.0).verdict == "-"
    assert {one.name for one in found} == {"plant", "agents of the same age", "all together"}
    assert judge_growth("files", growths(looks(growth), "files", ["plant"]), HOUR).verdict == "PASS"


@pytest.mark.parametrize(("row", "verdict", "found"), [
    (judge_late(1, 1000, 0.0), "PASS", ""),
    (judge_late(2, 1000, 0.0), "FAIL", ""),
    (judge_late(2, 1000, 0.3), "-", ""),
    (judge_times("heal", [0.1, 5.9], 6.0), "PASS", ""),
    (judge_times("heal", [0.1, 6.1], 6.0), "FAIL", ""),
    (judge_times("heal", [0.1, inf], 6.0), "FAIL", "worst never (1)"),
    (judge_times("heal", [0.1], 6.0, deaf=2), "PASS", "; 2 not counted"),
    (judge_times("heal", [], 6.0), "-", ""),
])  # fmt: skip
def test_a_thousandth_of_late_steps_fails_and_a_heal_that_is_slow(row: Finding, verdict: str, found: str) -> None:
    """If others had the machine, late steps are told and not judged; heals that this program did not hear neither."""
    assert row.verdict == verdict
    assert found in row.found


def test_two_agents_use_each_other_once_both_say_so() -> None:
    """One side is not enough, nor a status from before."""
    monitor = SoakMonitor()
    monitor.status(status("inv1", "inv2"), 1.0)
    assert not monitor.use_each_other(["inv1"], ["inv1", "inv2"])
    monitor.status(status("inv2", "inv1"), 2.0)

    assert monitor.use_each_other(["inv1"], ["inv1", "inv2"])
    assert not monitor.use_each_other(["inv1"], ["inv2"], since=1.5)
    assert not monitor.none_uses("inv1", ["inv2"])


def test_only_the_silence_of_agents_that_were_killed_is_explained() -> None:
    """The check of last words may name them and nobody else; every other check has to pass."""
    dead = Violation(text="sends nothing more", agent="inv3", t=12.0)
    words = CheckVerdict(check="last_words", status="failed", violations=(dead,), count=1)
    passed, failed = (CheckVerdict(check="heal", status=status) for status in ("passed", "failed"))

    assert judge_checks((passed, words), [dead], [("inv3", 11.9)]).verdict == "PASS"
    for verdicts, kills in (
        ((passed, words), []),
        ((passed, words), [("inv4", 11.9)]),
        ((passed, words), [("inv3", 50.0)]),
        ((passed, words), [("inv3", 11.9), ("inv3", 40.0)]),
        ((failed, words), [("inv3", 11.9)]),
        ((), []),
    ):
        assert judge_checks(verdicts, [dead], kills).verdict == "FAIL"


def test_a_frequency_that_moves_as_agents_find_each_other_again_is_told_and_no_failure() -> None:
    """Within 2 s of a heal, and at no other time; and only if the verdict shows all that the check has named."""

    def verdict(t: float, count: int = 1) -> CheckVerdict:
        out = Violation(text="abs(f - 60)", agent="inv7", t=t, value=0.0102, limit=0.01, unit="Hz")
        return CheckVerdict(check="frequency", status="failed", violations=(out,), count=count)

    found = judge_checks((verdict(863.59),), (), (), [100.0, 863.7])
    assert found.verdict == "PASS"
    assert "frequency names 1 x up to 0.0102 Hz within 2 s of a heal" in found.found
    assert judge_checks((verdict(866.0),), (), (), [100.0, 863.7]).verdict == "FAIL"
    assert judge_checks((verdict(863.59, 2),), (), (), [100.0, 863.7]).verdict == "FAIL"
    assert judge_checks((verdict(863.59),), (), ()).verdict == "FAIL"


def test_a_frequency_is_restored_once_it_holds() -> None:
    """Out of its band at 1 s, in at 2 s for 0.2 s, and for good at 3 s: restored after 2 s; others do not count."""
    monitor = SoakMonitor()
    monitor.config(replace(agent_config("inv1"), kind="GFM"))
    monitor.config(replace(agent_config("inv2"), kind="GFL"))

    def f(t: float) -> float:
        return 60.02 if 1.0 <= t < 2.0 or 2.2 <= t < 3.0 else 60.0

    rows = [(t, f(t), *(0.0,) * 5, 50.0, *(0.0,) * 5) for t in (round(0.1 * k, 9) for k in range(36))]
    monitor.telemetry(sound_message(Telemetry, t=3.5, inverters=("inv1", "inv2"), rows=rows), 9.0)

    assert monitor.restorations == pytest.approx([2.0])
    assert monitor.seconds_in_band == pytest.approx(0.5)
    assert monitor.real_time(4.0) == pytest.approx(9.5)


@pytest.mark.timeout(300)
@pytest.mark.skipif(sys.platform != "linux", reason="sizes of processes are from /proc")
def test_a_killed_agent_is_told_and_comes_back_and_a_cut_heals(tmp_path: Path) -> None:
    """Each time is measured, the sizes of plant, command and agents are there, no command fails, and the run ends."""
    few = gp.load("islanding").replace({"without_agent": ["inv2", "inv5", "inv6", "inv8", "inv9"]})
    (tmp_path / "few.toml").write_text(few.to_toml())
    microgrids = {"inv1": "MG1", "inv3": "MG1", "inv4": "MG2", "inv7": "MG3"}
    with SoakRun(tmp_path, microgrids, "inv10", scenario="few.toml", recorded=False) as run:
        run.disturb(SoakAction("kill", ("inv3",), 0.3))
        run.disturb(SoakAction("cut", ("inv4", "inv7"), 0.5))
        end = run.finish()

    assert {"told", "joined", "heal"} <= {timed.what for timed in run.times}
    assert [timed for timed in run.times if isinf(timed.seconds)] == []
    assert [name for name, _ in run.kills] == ["inv3"]
    assert {"plant", "command", *microgrids} == {size.name for size in run.sizes}
    last = {size.name: size for size in run.sizes}.values()  # an agent that has just been started is small
    assert [size for size in last if size.memory <= 5.0 or size.files <= 3] == []
    assert run.steps > 0
    assert (run.problems, end.status) == ([], 0)
