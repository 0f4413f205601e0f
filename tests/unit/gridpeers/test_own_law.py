"""A control law of the user's own: in a module, in a notebook, under a name."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.scenarios.schema.plugin_keys import law_of

MINE = '''
from typing import Annotated
import gridpeers as gp

class Mine(gp.Law):
    """Go to the neighbours' mean set-point, and against the own frequency error."""
    gain: Annotated[float, gp.Unit("1/s"), gp.Range(0, 100)] = 5.0
    def step(self, own, neighbours, T):
        mean = sum(n.P_set for n in neighbours) / len(neighbours) if neighbours else own.P_set
        change = min(1, self.gain * T) * (mean - own.P_set) - own.e  # in the catalogue all start from the mean
        return gp.SetPoints(P_set=own.P_set + change, V_set=own.V_set)
'''

STUDY = """
import json
import gridpeers as gp
changes = {"time.end_s": 1.1, "event": [{"label": "islanding", "t_s": 1.0, "open": ["13-152"]}]}
scenario = gp.load("islanding").replace(changes)
"""

IN_A_MODULE = (
    STUDY
    + """
from mine import Mine
by_class, by_name = (scenario.replace({"case.IV.law": law}) for law in (Mine, "mine:Mine"))
table = gp.sweep(by_class, {"case.IV.law.gain": [1.0, 5.0]}, cases=["IV"], jobs=2)
runs = by_class.run("IV"), by_name.run("IV", driver="processes")
print(json.dumps([run.sha256 for run in runs] + table["history_sha256"].tolist()))
"""
)


IN_A_NOTEBOOK = (
    MINE
    + STUDY
    + """
Mine = gp.law("mine")(Mine)
by_class, by_name = (scenario.replace({"case.IV.law": law}) for law in (Mine, "mine"))
print(json.dumps([run.run("IV").sha256 for run in (by_class, by_name)]))
try:
    by_name.run("IV", driver="processes")
except gp.ScenarioError as error:
    print(error)
"""
)


def outputs(folder: Path, code: str) -> list[str]:
    """Lines that a script prints, started in a folder as a user would."""
    (folder / "study.py").write_text(code)
    done = subprocess.run([sys.executable, "study.py"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_law_beside_the_script_runs_in_one_process_and_in_many(tmp_path: Path) -> None:
    """The class and its reference are one law, found by every process of a run and of a sweep: the same bytes."""
    (tmp_path / "mine.py").write_text(MINE)

    (line,) = outputs(tmp_path, IN_A_MODULE)

    one, two, slow, four = json.loads(line)
    assert one == two == four != slow


def test_a_law_of_a_notebook_runs_where_it_is_and_is_refused_elsewhere(tmp_path: Path) -> None:
    """A law that only the script knows runs in its process; a run with processes says what to do before it starts."""
    line, refusal = outputs(tmp_path, IN_A_NOTEBOOK)

    assert len(set(json.loads(line))) == 1
    assert refusal.startswith("case IV: the law Mine is defined in a notebook")
    assert 'driver="inprocess"' in refusal


def test_a_law_under_a_name_is_written_by_its_module(monkeypatch: pytest.MonkeyPatch) -> None:
    """A decorator's name is known to one process; a scenario holds the reference, and the folder to find it in."""
    monkeypatch.setattr(LAWS, "_added", {})

    @gp.law("mine")
    class Mine(gp.Law):
        def step(self, own: gp.Own, neighbours: object, T: float) -> gp.SetPoints:
            return gp.SetPoints(own.P_set, own.V_set)

    monkeypatch.setitem(globals(), "Mine", Mine)
    Mine.__qualname__ = "Mine"

    law = law_of(gp.load("islanding").replace({"law": "mine"}).spec, "IV")

    assert law.use == f"{__name__}:Mine"
