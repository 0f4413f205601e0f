"""A law that fails is named, its agent is idle, and the run continues; one that cannot work is refused before."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import gridpeers as gp
from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.program import ProgramLaw
from tests.conformance.laws.law_runs import SHORT, failed, written

BAD = "tests.conformance.laws.bad_laws"


@pytest.mark.parametrize(("how", "said"), [
    ("nothing", r"step at t = 1.2 s returned None; return SetPoints\(P_set=..., V_set=...\)"),
    ("leaves", r"step at t = 1.2 s raised SystemExit: 3"),
    ("hangs in spite of all", r"step at t = 1.2 s took longer than time_limit_s = 0.3 s"),
])  # fmt: skip
def test_a_failing_class_is_named_and_the_run_continues(how: str, said: str) -> None:
    """A failing step gives one line of every agent in events.csv, primary droop from then on, a history to the end."""
    limit = {"time_limit_s": 0.3} if how.startswith("hangs") else {}  # the default is out of a starved machine's reach
    result = failed({"use": f"{BAD}:Failing", "how": how, **limit})
    told = result.events[result.events["kind"] == "law"]

    assert list(told["subject"]) == [f"inv{i}" for i in range(1, 10)]
    line = r"\(\S*bad_laws.py:\d+\)"
    assert all(re.search(f"law {BAD}:Failing {line}: {said}; its agent is idle", text) for text in told["text"]), told
    assert result.history.index[-1] == 1.5
    assert 59.0 < result.history["inv1"]["f"].iloc[-1] < 60.0


MINE = """import gridpeers as gp

class Mine(gp.Law):
    def step(self, own, neighbours, T):
        return gp.SetPoints(share(own), own.V_set)

def share(own):
    return own.P_set / (0.0 if own.t > 1.{late} else 1.0)

def star(members):
    hub = "inv1" if len(members) == 9 else members["nobody"]
    return {{name: {{hub}} - {{name}} for name in members}}
"""
"""A law that fails in its line 8, and a graph that fails in its line 11."""


@pytest.fixture
def mine(tmp_path: Path) -> str:
    """Folder with the module late_laws, which fails in the last tick but one, and early_laws."""
    (tmp_path / "late_laws.py").write_text(MINE.format(late=47))
    (tmp_path / "early_laws.py").write_text(MINE.format(late=2))
    return str(tmp_path)


def test_a_law_that_fails_in_the_last_tick_fails_the_run(mine: str) -> None:
    """The check, the report and the table name its file and line, as the scenario sees it, also at 1.48 of 1.5 s."""
    result = failed({"use": "late_laws:Mine", "folder": mine}, driver="processes")
    why = r"law late_laws:Mine \(late_laws.py:8\): step at t = 1.48 s raised ZeroDivisionError: float division by zero"

    assert result.checks.loc["law_failed", "status"] == "failed"
    assert re.match(rf"FAILED  case IV: inv1 at t = 1.48 s: {why}; and 8 more\n", result.report), result.report
    assert list(result.failures["agent"]) == [f"inv{i}" for i in range(1, 10)]
    assert all("(late_laws.py:8)" in why for why in result.failures["why"])
    assert (set(result.failures["t"]), set(result.failures["case"])) == ({1.48}, {"IV"})
    assert result.history.index[-1] == 1.5


def test_a_law_that_fails_ends_the_run_where_the_scenario_wants_that(mine: str) -> None:
    """`on_law_failure = "stop"`: the run ends at the tick of the failure, which its error names with file and line."""
    law = {"use": "early_laws:Mine", "folder": mine}
    stopping = gp.load("islanding").replace({"case.IV.law": law, **SHORT, "on_law_failure": "stop"})

    with pytest.raises(gp.BrokenRunError, match=r"at t = 1.22 s, .* inv1: law early_laws:Mine \(early_laws.py:8\): st"):
        stopping.run("IV")


def test_a_sweep_whose_law_fails_has_no_numbers(mine: str) -> None:
    """The row has the status `law failed`, a reason and no numbers; one warning covers all runs."""
    law = {"use": "early_laws:Mine", "folder": mine}
    base = gp.load("islanding").replace({"case.IV.law": law, **SHORT})

    with pytest.warns(RuntimeWarning, match=r"a law failed, run 2: inv1 at .* \(early_laws.py:8\).*in 1 more") as told:
        table = gp.sweep(base, {"case.IV.law": ["dapi", law], "on_law_failure": ["droop", "stop"]}, cases="IV", jobs=1)

    assert len(told) == 1
    assert list(table["status"]) == ["ran", "ran", "law failed", "law failed"]
    named = table["why"].str.contains("early_laws.py:8", regex=False).fillna(value=False)
    assert list(named) == list(table["event1.f_error_Hz"].isna()) == [False, False, True, True]
    with pytest.warns(RuntimeWarning, match="a law failed, run 0"):
        assert gp.sweep(base, {"seed": [1]}, cases="IV", jobs=1, metrics="MPSI")["status"].tolist() == ["law failed"]


def test_a_graph_that_fails_in_a_run_is_a_failure_like_a_law(mine: str) -> None:
    """The scenario kills an agent, and the check has not seen the remaining roster."""
    dies = {"name": "inv9", "kill": True, "from_s": 1.2}
    graph = {"use": "late_laws:star", "folder": mine}
    scenario = gp.load("islanding").replace({**SHORT, "case.IV.graph": graph, "node": [dies]})

    with pytest.warns(
        RuntimeWarning, match=r"inv1 at t = 1.20 s: graph late_laws:star \(late_laws.py:11\) of inv1, inv2"
    ):
        result = scenario.run("IV")

    assert result.checks.loc["law_failed", "status"] == "failed"
    assert len(result.failures) == 8


def test_a_program_that_fails_is_named_and_leaves_no_process() -> None:
    """It never answers a step; the ways to fail are those of test_failing_carriers.py."""
    silent = 'read -r _; echo \'{"type": "ready"}\'; sleep 600'
    result = failed({"command": ["sh", "-c", silent], "time_limit_s": 0.5})
    told = list(result.events[result.events["kind"] == "law"]["text"])

    assert len(told) == 9
    assert all(re.search(r"did not answer the step at t = [\d.]+ s within 0.5 s", text) for text in told), told
    assert result.history.index[-1] == 1.5
    assert not [path for path in Path("/proc").glob("[0-9]*/cmdline") if silent in _text(path)]


def _text(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except OSError:  # it has just ended
        return ""


@pytest.mark.parametrize(("law", "said"), [
    ("dapy", r'case.IV.law: there is no law "dapy"; did you mean "dapi"\? The laws are consensus, dapi, .*module:Name'),
    ("mine:Mine", r'case.IV.law.*: there is no module "mine" in .* on the Python path'),
    (f"{BAD}:Fail", rf'case.IV.law.*: {BAD}:Fail: module {BAD} has no "Fail"; did you mean "Failing"\?'),
    (f"{BAD}:no_class", r"no_class is no law: derive a class from gridpeers.Law"),
    (f"{BAD}:WrongStep", r"WrongStep is no law: write its method step\(self, own, neighbours, T\): too many"),
    (f"{BAD}:Unmakeable", r"Unmakeable cannot be made: RuntimeError: no licence"),
    ({"use": f"{BAD}:NeverMade", "time_limit_s": 0.01}, r"cannot be made: its __init__ took longer than 0.1 s, ten t"),
    (f"{BAD}:NamedAsAKey", r"is no law: its parameter folder cannot be given, as a scenario has the key folder for s"),
    ({"use": f"{BAD}:Failing", "gain": 500}, r"case.IV.law.gain: must be from 0 to 100 1/s, got 500"),
    ({"use": "consensus", "k_p": 1.0}, r"case.IV.law.k_p: the parameters of .consensus. are those of \[gains\]"),
    ({}, r'case.IV.law: needs one of use, command, fmu; got none; e.g. law = "mine:Mine"'),
    ({"use": "dapi", "fmu": "x.fmu"}, r"case.IV.law: needs one of use, command, fmu; got use and fmu"),
    ({"command": ["ls"], "folder": "/nowhere"}, r"case.IV.law.folder: there is no folder /nowhere"),
    ({"use": "dapi", "P_set_min": 1.0, "P_set_max": 0.5}, r"law.P_set_min: 1 pu must not be above P_set_max = 0.5 pu"),
    ({"command": "./nothing"}, r"case.IV.law.command: must be a list such as .*, the program first"),
    ({"fmu": __file__, "folder": "/"}, r"case.IV.law.fmu: test_failing_laws.py is no FMU: BadZipFile"),
])  # fmt: skip
def test_a_law_that_cannot_work_is_refused_before_anything_starts(law: Any, said: str) -> None:
    """Each problem has its key and a remedy."""
    with pytest.raises(gp.ScenarioError) as refused:
        gp.load("islanding").replace({"case.IV.law": law, **SHORT}).check()

    assert len(refused.value.problems) == 1
    assert re.search(said, refused.value.problems[0]), refused.value.problems


@pytest.mark.parametrize("text", ["print(1)\n", "#!/nowhere/python\n"])
def test_a_program_that_the_system_cannot_run_is_refused(text: str, tmp_path: Path) -> None:
    """The run does not begin."""
    file = tmp_path / "law"
    file.write_text(text)
    file.chmod(0o755)

    with pytest.raises(ValueError, match=r"law program \./law: .* name the interpreter in the first line"):
        ProgramLaw(LawChoice(command=("./law",), folder=str(tmp_path)))


def test_gains_of_the_papers_law_in_a_case_of_another_are_refused() -> None:
    """Such gains would have no effect."""
    with pytest.raises(gp.ScenarioError, match=r'\[gains\] belong to the law "consensus", and this case has dapi'):
        gp.load("islanding").replace({"case.IV.law": "dapi", "case.IV.gains": {"k_p": 0.001}}).check()
    weights = {"weights": "degree-normalised"}
    with pytest.raises(
        gp.ScenarioError, match=r'case.IV.degraded_communication.weights: weights other than "paper" belong to the law'
    ):
        gp.load("islanding").replace({"case.IV.law": "dapi", "case.IV.degraded_communication": weights}).check()


def test_a_module_that_ends_python_while_it_is_imported_is_refused(tmp_path: Path) -> None:
    """A script without a `__main__` guard, outside of the tests that pytest imports."""
    (tmp_path / "leaving_law.py").write_text("import sys\nsys.exit(3)\n")

    with pytest.raises(gp.ScenarioError, match="importing leaving_law failed: SystemExit: 3"):
        written({"use": "leaving_law:Mine", "folder": str(tmp_path)})


def test_a_module_that_was_edited_is_read_again(tmp_path: Path) -> None:
    """A law that changes between two runs of a notebook takes effect with both drivers."""
    text = "import gridpeers as gp\nclass Hold(gp.Law):\n    def step(self, own, neighbours, T):\n        return "
    module = tmp_path / "edited_law.py"
    law = {"use": "edited_law:Hold", "folder": str(tmp_path)}
    module.write_text(text + "gp.SetPoints(own.P_set, own.V_set)\n")
    first = written(law)
    module.write_text(text + "gp.SetPoints(0.9 * own.P_set, own.V_set)\n")
    os.utime(module, ns=(0, 10**18))

    assert written(law).sha256 != first.sha256


class Wanders(gp.Law):
    """Holds its set-points, somewhere else."""

    def step(self, own: gp.Own, neighbours: Sequence[gp.Neighbour], T: float) -> gp.SetPoints:
        os.chdir("/")
        return gp.SetPoints(own.P_set, own.V_set)


def test_the_run_is_written_into_its_folder_and_read_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder is where it was when it was named."""
    monkeypatch.chdir(tmp_path)
    scenario = gp.load("islanding").replace({"case.IV.law": Wanders, **SHORT})
    written = scenario.run("IV", folder="here")

    assert Path.cwd() == Path("/")
    assert (tmp_path / "here" / "status.txt").read_text() == "complete\n"
    assert written.history.index[-1] == 1.5

    monkeypatch.chdir(tmp_path)
    read = gp.read("here")
    os.chdir("/")
    assert read.sha256 == written.sha256
