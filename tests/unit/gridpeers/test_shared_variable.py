"""The law with a shared variable of docs/how-to/plug-ins.md, and the readers of that variable."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import pandas as pd
import pytest

import gridpeers as gp
from gridpeers.runs.export import export
from gridpeers.scenarios.record.record_file import RecordFileError
from tests.pages.page import blocks_of

PAGES = Path(__file__).parents[3] / "docs" / "how-to"
SHORT = {"time.end_s": 1.1, "event": [{"label": "event1", "t_s": 1.0, "open": ["13-152"]}], "paper": ""}


def copy(page: str, name: str, folder: Path) -> Path:
    blocks = blocks_of((PAGES / page).read_text(encoding="utf-8"))
    (code,) = (block.text for block in blocks if block.comments.get("file") == name)
    (folder / name).write_text(code, encoding="utf-8")
    return folder / name


@pytest.fixture
def law(tmp_path: Path) -> dict[str, str]:
    copy("plug-ins.md", "omega.py", tmp_path)
    return {"use": "omega:Averaging", "folder": str(tmp_path)}


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


def test_a_program_shares_what_the_class_does(law: dict[str, str], tmp_path: Path) -> None:
    """The program of docs/how-to/law-programs.md declares it in the scenario: equal bits, equal unit."""
    file = copy("law-programs.md", "law.py", tmp_path)
    declared = [{"name": "Omega", "unit": "pu", "low": -0.05, "high": 0.05}]
    program = {"command": [sys.executable, str(file)], "time_limit_s": 30.0, "shared": declared}

    one, other = (gp.load("islanding").replace({**SHORT, "case.IV.law": of}).run("IV") for of in (law, program))

    assert one.sha256 == other.sha256
    assert one.quantity("Omega").equals(other.quantity("Omega"))
    assert other.quantity("Omega").attrs["units"]["Omega"] == "pu"


def test_an_export_has_a_table_of_it(law: dict[str, str], tmp_path: Path) -> None:
    """A column for each inverter, with name and unit, has the same numbers."""
    result = gp.load("islanding").replace({**SHORT, "case.IV.law": law}).run("IV")

    files = export(result.run_record, "csv", tmp_path)

    assert [file.name for file in files] == ["history.csv", "events.csv", "shared.csv"]
    table = pd.read_csv(tmp_path / "shared.csv", index_col="t_s")
    assert list(table.columns) == [f"inv{i}_Omega_pu" for i in range(1, 10)]
    assert table.to_numpy() == pytest.approx(result.quantity("Omega").to_numpy(), rel=1e-12)
