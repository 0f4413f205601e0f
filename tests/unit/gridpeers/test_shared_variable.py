"""The recipe of docs/laws.md for a law with a shared variable, followed to the letter; and what reads it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Literal

import pandas as pd
import pytest

import gridpeers as gp
from gridpeers.runs.export import export
from gridpeers.scenarios.record.record_file import RecordFileError

DOCS = Path(__file__).parents[3] / "docs" / "laws.md"
SHORT = {"time.end_s": 1.1, "event": [{"label": "event1", "t_s": 1.0, "open": ["13-152"]}], "paper": ""}


def recipe() -> str:
    """The file of the recipe, as written."""
    (code,) = re.findall(
        r"^```python\n(\"\"\"A law that shares.*?)^```$", DOCS.read_text(encoding="utf-8"), re.M | re.S
    )
    return str(code)


@pytest.fixture
def law(tmp_path: Path) -> dict[str, str]:
    (tmp_path / "omega.py").write_text(recipe(), encoding="utf-8")
    return {"use": "omega:Averaging", "folder": str(tmp_path)}


def test_the_recipe_is_one_file_that_runs_and_draws(tmp_path: Path) -> None:
    (tmp_path / "omega.py").write_text(recipe(), encoding="utf-8")

    done = subprocess.run([sys.executable, "omega.py"], cwd=tmp_path, capture_output=True, text=True, check=False)

    assert done.returncode == 0, done.stderr
    assert "inv9" in done.stdout
    assert (tmp_path / "Omega.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("driver", ["inprocess", "processes"])
def test_a_shared_quantity_is_read_and_drawn_whatever_the_driver(
    law: dict[str, str], driver: Literal["inprocess", "processes"], tmp_path: Path
) -> None:
    """From the states of the record: five ticks of nine inverters, as m_p P_set, which the law makes of it."""
    result = gp.load("islanding").replace({**SHORT, "case.IV.law": law}).run("IV", driver=driver)

    Omega, P_set = result.quantity("Omega"), result.quantity("P_set")
    assert Omega.attrs["units"] == {"t": "s", "Omega": "pu"}
    assert list(Omega.index) == pytest.approx([1.02, 1.04, 1.06, 1.08])
    assert list(Omega.columns) == list(P_set.columns)
    assert result.plot("Omega").axes[0].get_ylabel() == "Omega (pu)"
    with pytest.raises(RecordFileError, match='there is no quantity "Omga"; did you mean "Omega"'):
        result.quantity("Omga")
    result.save(tmp_path / "run")
    assert (tmp_path / "run" / "plots" / "Omega.png").exists()
    assert gp.read(tmp_path / "run").quantity("Omega").equals(Omega)


PROGRAM = """
import json, sys
for line in sys.stdin:
    asked = json.loads(line)
    own = asked["own"]
    if asked["type"] == "start":
        Omega = own["m_p"] * own["P_set"]
        print('{"type": "ready"}', flush=True)
        continue
    others = [n["shared"]["Omega"] for n in asked["neighbours"] if "Omega" in n["shared"]]
    Omega += 0.5 * (sum(others) / len(others) - Omega if others else 0.0) - asked["T"] / 0.2 * own["e"]
    print(json.dumps({"P_set": Omega / own["m_p"], "V_set": own["V_set"], "shared": {"Omega": Omega}}), flush=True)
"""


def test_a_program_shares_what_the_class_does(law: dict[str, str], tmp_path: Path) -> None:
    """Declared in the scenario: the same quantity, to the last bit, with the same unit."""
    (tmp_path / "law.py").write_text(PROGRAM, encoding="utf-8")
    declared = [{"name": "Omega", "unit": "pu", "low": -0.05, "high": 0.05}]
    program = {"command": [sys.executable, str(tmp_path / "law.py")], "time_limit_s": 30.0, "shared": declared}

    one, other = (gp.load("islanding").replace({**SHORT, "case.IV.law": of}).run("IV") for of in (law, program))

    assert one.sha256 == other.sha256
    assert one.quantity("Omega").equals(other.quantity("Omega"))
    assert other.quantity("Omega").attrs["units"]["Omega"] == "pu"


def test_an_export_has_a_table_of_it(law: dict[str, str], tmp_path: Path) -> None:
    """The same numbers, in a column for each inverter with name and unit."""
    result = gp.load("islanding").replace({**SHORT, "case.IV.law": law}).run("IV")

    files = export(result.run_record, "csv", tmp_path)

    assert [file.name for file in files] == ["history.csv", "events.csv", "shared.csv"]
    table = pd.read_csv(tmp_path / "shared.csv", index_col="t_s")
    assert list(table.columns) == [f"inv{i}_Omega_pu" for i in range(1, 10)]
    assert table.to_numpy() == pytest.approx(result.quantity("Omega").to_numpy(), rel=1e-12)
