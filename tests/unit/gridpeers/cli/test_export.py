"""`gridpeers export`: the tables of a record for other programs, whole or as far as a killed run came."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat

import gridpeers as gp
from gridpeers.cli import usage
from gridpeers.runs import export
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke

Tables = dict[str, pd.DataFrame]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two cases, one with a delay and losses on every link."""
    islanding = gp.load("islanding").replace({"paper": None})
    event = islanding.tables["event"][0] | {"t_s": 0.1}
    lossy = {"case.IV.link": [{"on": "* <-> *", "delay": 0.01, "loss": 0.1}]}
    scenario = islanding.replace({"event": [event], "time.end_s": 0.5} | lossy)
    folder = tmp_path_factory.mktemp("export") / "run"
    scenario.run(["I", "IV"], folder=folder)
    return folder


def exported(run: Path, to: str, out: Path) -> Path:
    code, text = invoke("export", str(run / "IV"), "--to", to, "--out", str(out))
    assert code == 0, text
    assert len(text.splitlines()) == len(list(out.iterdir()))
    return out


def of_csv(folder: Path) -> Tables:
    return {name: pd.read_csv(folder / f"{name}.csv") for name in NAMES}


NAMES = ("history", "events", "links")


def test_csv_files_are_those_that_the_run_wrote(run: Path, tmp_path: Path) -> None:
    """Byte by byte; a folder of several cases gives a folder for each."""
    code, text = invoke("export", str(run), "--out", str(tmp_path / "all"))

    assert (code, len(text.splitlines())) == (0, 5), text
    for name in ("I/history.csv", "I/events.csv", "IV/history.csv", "IV/events.csv", "IV/links.csv"):
        assert (tmp_path / "all" / name).read_bytes() == (run / name).read_bytes()


def read_mat(folder: Path) -> Tables:
    content = loadmat(folder / "run.mat", simplify_cells=True)

    def column(values: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> object:
        return np.char.strip(values) if values.dtype.kind == "U" else values

    return {name: pd.DataFrame({key: column(of) for key, of in content[name].items()}) for name in NAMES}


@pytest.mark.parametrize(("to", "package", "read"), [
    ("parquet", "pyarrow", lambda it: {name: pd.read_parquet(it / f"{name}.parquet") for name in NAMES}),
    ("feather", "pyarrow", lambda it: {name: pd.read_feather(it / f"{name}.feather") for name in NAMES}),
    ("xlsx", "openpyxl", lambda it: pd.read_excel(it / "run.xlsx", sheet_name=None)),
    ("mat", "scipy", read_mat),
])  # fmt: skip
def test_other_formats_have_the_same_tables(
    to: str, package: str, read: Callable[[Path], Tables], run: Path, tmp_path: Path
) -> None:
    """The same columns and numbers; the delay of a message that was lost is no number."""
    pytest.importorskip(package)

    found, expected = read(exported(run, to, tmp_path / to)), of_csv(run / "IV")

    assert list(found) == list(expected)
    for name in NAMES:
        pd.testing.assert_frame_equal(found[name], expected[name], check_dtype=False, rtol=1e-14)
    table = RunRecord.open(run / "IV").physics().table
    assert to == "xlsx" or np.array_equal(found["history"].to_numpy(), table)  # Excel keeps 15 digits
    assert found["links"]["delay_s"].isna().any()


def test_of_a_record_that_is_cut_off_there_is_what_it_has(run: Path, tmp_path: Path) -> None:
    """As after kill -9; a note says where it ends."""
    whole = (run / "IV" / "run.mcap").read_bytes()
    (tmp_path / "run.mcap").write_bytes(whole[:-200])

    code, text = invoke("export", str(tmp_path / "run.mcap"), "--to", "csv")

    assert code == 0, text
    assert "NOTE" in text
    assert "cut off" in text
    rows = (tmp_path / "history.csv").read_text().splitlines()
    assert rows == (run / "IV" / "history.csv").read_text().splitlines()[: len(rows)]


@pytest.mark.parametrize(("words", "complaint"), [
    (("nowhere",), "nowhere: cannot be read: No such file or directory"),
    (("{run}", "--case", "V"), 'no record of case "V"'),
    (("{run}", "--to", "hdf"), "--to.*hdf.*xlsx"),
    (("{run}/IV", "--to", "xlsx"), "history has 51 rows, and a sheet of xlsx takes 20; use --to"),
    (("{run}/IV", "--to", "parquet"), r"pyarrow is not installed, .* pip install .*\[export\]'"),
])  # fmt: skip
def test_bad_input_is_one_line(
    words: tuple[str, ...], complaint: str, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 2, and nothing is written."""
    monkeypatch.setattr(export, "SHEET", 20)
    monkeypatch.setattr(usage.util, "find_spec", lambda name: name != "pyarrow" or None)

    code, text = invoke("export", *(word.format(run=run) for word in words))

    assert code == 2
    assert re.search(complaint, " ".join(text.split()))
