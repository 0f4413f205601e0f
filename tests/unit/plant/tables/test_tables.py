import csv
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.plant.tables.read import DATA


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of microgrid123 to break."""
    return Path(shutil.copytree(DATA / "microgrid123", tmp_path / "mine"))


def edit(folder: Path, file: str, row: int, **cells: str) -> None:
    """Change cells of one row, also of a further column; the header is row 1, a row beyond the end repeats the last."""
    with (folder / file).open(newline="") as stream:
        table = list(csv.DictReader(stream))
    if row - 2 == len(table):
        table.append(dict(table[-1]))
    table[row - 2] |= cells
    with (folder / file).open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(table[0] | cells))
        writer.writeheader()
        writer.writerows(table)


def problems(folder: Path, load_set: str = "main") -> tuple[str, ...]:
    with pytest.raises(FeederError) as caught:
        read_feeder(str(folder), load_set)
    return caught.value.problems


def zone_powers(feeder: Tables) -> dict[str, complex]:
    """Sum of the loads of each zone (VA)."""
    zone = {bus.name: bus.zone for bus in feeder.buses}
    powers: dict[str, complex] = {}
    for load in feeder.loads:
        powers[zone[load.bus]] = powers.get(zone[load.bus], 0j) + sum(load.S)
    return powers


def test_tables_are_read_again_when_a_file_has_other_bytes(folder: Path) -> None:
    """A feeder that did not change is the one read before; an edit is seen, and its problems are reported each time."""
    first = read_feeder(str(folder))

    assert read_feeder(str(folder)) is first
    assert (first.name, first.loads) == ("mine", read_feeder("microgrid123").loads)
    edit(folder, "lines.csv", 2, length_m="321")
    assert read_feeder(str(folder)).lines[0].length == 0.321
    edit(folder, "lines.csv", 2, length_m="-1")
    assert problems(folder) == problems(folder) != ()


def test_loads_are_the_published_ones_and_those_of_the_microgrids() -> None:
    """3490 kW of the standard feeder; of ours by zones, MG1 with only inverters; event2 drops 1360 kW at event 2."""
    feeder = read_feeder("standard123")
    main, event2 = (zone_powers(read_feeder("microgrid123", load_set)) for load_set in ("main", "event2"))

    assert sum(sum(load.S) for load in feeder.loads) == 3490e3 + 1920e3j
    assert (len(feeder.buses), len(feeder.lines), len(feeder.loads), len(feeder.inverters)) == (130, 118, 85, 0)
    assert main == {"rest": 760e3 + 380e3j, "passive": 1252e3 + 660e3j, "MG2": 985e3 + 550e3j, "MG3": 1195e3 + 690e3j}
    assert event2["passive"].real == 1360e3
    assert [event2[zone] / main[zone] for zone in ("MG2", "MG3")] == pytest.approx([0.95, 0.95])


FLOATING = 'bus "610" is behind a delta winding without ground'
MISTAKES: list[tuple[str, int, dict[str, str], str]] = [
    ("buses.csv", 3, {"phases": "BX"}, 'phases must be letters out of A, B, C, each once (as "ABC" or "B"), got "BX"'),
    ("buses.csv", 136, {"bus": "162"}, 'bus "162" exists already; names must differ'),
    ("lines.csv", 5, {"to_bus": "47x"}, 'to_bus "47x": no such bus; did you mean "47"?'),
    ("lines.csv", 5, {"to_bus": ""}, "to_bus is empty; give a name"),
    ("lines.csv", 5, {"to_bus": "3"}, 'both ends are bus "3"; a branch needs two buses'),
    ("lines.csv", 2, {"phases": "A", "config": "9"}, 'bus "2" has no phase A; it has B'),
    ("lines.csv", 4, {"length_m": "-5"}, "length_m: the length of a line must be above 0, got -5 m; "),
    ("lines.csv", 4, {"length_m": "300 ft"}, 'length_m must be a number, got "300 ft"'),
    ("lines.csv", 4, {"config": "13"}, 'config "13": no such line configuration; '),
    ("lines.csv", 4, {"config": "7"}, 'config "7" is for phases AC, the line carries ABC'),
    ("lines.csv", 122, {"line": "extra", "to_bus": "610"}, "a line between buses of 4.16 kV and 0.48 kV; "),
    ("line_configs.csv", 3, {"phase_2": "D"}, 'phase_2 "D": no such phase; choose one of A, B, C'),
    ("line_configs.csv", 53, {}, 'config "12" element C-C: given already; give each element once'),
    ("switches.csv", 2, {"state": "shut"}, 'state "shut": no such state of a switch; choose one of closed, open'),
    ("switches.csv", 5, {"alias": "sw1_2"}, 'switch "sw1_2" exists already; names must differ'),
    ("switches.csv", 11, {"phases": "AB"}, 'bus "94" has no phase B; it has A'),
    ("regulators.csv", 3, {"tap": "-161"}, "tap, tap_step_pu: -0.00625 is not plausible for "),
    ("transformers.csv", 2, {"connection": "D-Yg"}, 'connection "D-Yg": no such connection of a transformer; '),
    ("transformers.csv", 2, {"X_percent": "0"}, "X_percent: the reactance of a transformer must be above 0, got 0 %"),
    ("loads_main.csv", 2, {"model": "ZIP"}, 'model "ZIP": no such load model; choose one of P, I, Z'),
    ("loads_main.csv", 3, {"P_c_kW": "5"}, 'bus "2" has a load on phase C but no phase C; it has B'),
    ("loads_main.csv", 3, {"connection": "D"}, 'bus "2" has a load between B and C but no phase C; it has B'),
    ("loads_main.csv", 90, {"bus": "610"}, f"{FLOATING}, and a Y load needs ground; "),
    ("inverters.csv", 3, {"bus": "610"}, f"{FLOATING}, and an inverter needs ground; "),
    ("capacitors.csv", 7, {"bus": "610", "V_rated_kV_LN": "0.277"}, f"{FLOATING}, and a capacitor bank needs ground; "),
    ("capacitors.csv", 3, {"Q_b_kvar": "50"}, 'bus "88" has no phase B; it has A'),
    ("inverters.csv", 11, {"spare": "no"}, 'spare "no": must be "yes" or empty'),
    ("inverters.csv", 3, {"bus": "160"}, 'bus "160" has inverter "inv1" on phase A already; each'),
    ("inverters.csv", 3, {"bus": "94", "phases": "B"}, 'bus "94" has no phase B; it has A'),
    ("inverters.csv", 3, {"phases": "AB"}, 'phases "AB": must be "ABC" or "A" or "B" or "C" or empty'),
    ("inverters.csv", 3, {"bus": "160", "phases": "C"}, 'bus "160" has inverter "inv1" on phase C already; each'),
    ("inverters.csv", 2, {"parameters": "regfm"}, 'parameters "regfm": no such set; did you mean "regfm_a1"?'),
    ("inverters.csv", 3, {"parameters": "regfm_a1"}, 'parameters "regfm_a1": a GFL has no model = "regfm_a1"'),
    ("inverters.csv", 2, {"P_rated_kW": "600000"}, "P_rated_kW: 600000 kW is not plausible for an inverter"),
    ("inverters.csv", 2, {"m_q_pu": "5"}, "m_q_pu: 5 pu is not plausible for a Q-V droop"),
    ("line_configs.csv", 2, {"R_ohm_per_km": "284"}, "R_ohm_per_km: 284 ohm/km is not plausible for the resistance "),
    ("line_configs.csv", 3, {"B_uS_per_km": "1e4"}, "B_uS_per_km: 10000 uS/km is not plausible for the susceptance "),
    ("loads_main.csv", 2, {"Q_a_kvar": "-20000"}, "Q_a_kvar: -20000 kvar is not plausible for a load on "),
    ("capacitors.csv", 3, {"Q_a_kvar": "50000"}, "Q_a_kvar: 50000 kvar is not plausible for a capacitor "),
    (
        "capacitors.csv",
        3,
        {"V_rated_kV_LN": "4.16"},
        "V_rated_kV_LN: 4.16 kV is not plausible for a capacitor bank at ",
    ),
    (
        "transformers.csv",
        2,
        {"S_rated_kVA": "150000"},
        "S_rated_kVA: 150000 kVA is not plausible for a transformer at ",
    ),
    ("regulators.csv", 3, {"tap": "100"}, "tap, tap_step_pu: 1.625 is not plausible for the ratio of a regulator"),
    ("inverters.csv", 3, {"microgrid": "MG\x1b[31m1"}, "microgrid 'MG\\x1b[31m1': has characters"),
    ("source.csv", 3, {}, "a second source; a feeder has at most one"),
]


@pytest.mark.parametrize(("file", "row", "cells", "told"), MISTAKES, ids=[f"{m[0]}-{m[3][:40]}" for m in MISTAKES])
def test_each_problem_is_reported_once(folder: Path, file: str, row: int, cells: dict[str, str], told: str) -> None:
    """It has file, row, value and the remedy, and causes no further problems."""
    edit(folder, file, row, **cells)

    found = problems(folder)

    assert len(found) == 1, found
    assert found[0].startswith(f"{file} row {row}: {told}")


def test_all_problems_come_at_once(folder: Path) -> None:
    """Problems in several tables are raised together, in one exception whose text lists them."""
    edit(folder, "lines.csv", 4, length_m="-5", config="13")
    edit(folder, "loads_main.csv", 12, bus="47x", model="PQ")
    edit(folder, "inverters.csv", 2, bus="")

    with pytest.raises(FeederError, match="has 5 problems") as caught:
        read_feeder(str(folder))

    assert len(caught.value.problems) == 5
    assert all(problem in str(caught.value) for problem in caught.value.problems)


def without(start: str) -> Callable[[str], str]:
    return lambda text: "".join(line for line in text.splitlines(True) if not line.startswith(start))


NOT_UTF8 = "buses.csv: line 136 has byte 0xfc, which is not UTF-8 (Windows or Latin-1?)"
CHANGED: list[tuple[str, Callable[[str], str | bytes], str]] = [
    (
        "lines.csv",
        lambda text: text.replace("length_m", "length", 1),
        'lines.csv: no column "length_m"; did you mean "l',
    ),
    (
        "lines.csv",
        lambda text: text.replace("origin,note", "length_m,note"),
        'lines.csv: column "length_m" appears twice',
    ),
    ("lines.csv", without("L67_72,"), "buses.csv: 23 buses not connected with the substation at bus 150"),
    ("lines.csv", lambda text: text.replace(",29,30,ABC,2,", ",29,30,A,9,"), "buses.csv: 2 buses not connected with"),
    (
        "transformers.csv",
        lambda text: f"{text}T,61,610,D-D,150,1.27,2.72,no, or little\n",
        "transformers.csv row 3: 1 more cells",
    ),
    ("loads_main.csv", lambda text: b"\xff\xfebus", "loads_main.csv: is damaged"),
    ("buses.csv", lambda text: (text + "süd\n").encode("cp1252"), NOT_UTF8),
    (
        "buses.csv",
        lambda text: f"{text}999,AB,4.16,MG1,0,0,\n",
        "buses.csv: 1 bus not connected with the substation at ",
    ),
    ("buses.csv", lambda text: "bus,phases,V_nom_kV_LL\n", "buses.csv: has no rows; a feeder needs at least one bus"),
    ("line_configs.csv", without("1,A,B"), 'line_configs.csv row 6: config "1" lacks element A-B; '),
    (
        "line_configs.csv",
        lambda text: text.replace("0.311741927", "2.3", 1),
        'line_configs.csv row 7: config "1" has an X matrix',
    ),
    ("feeder.toml", lambda text: "f_nom_Hz = 50000", "feeder.toml: f_nom_Hz: 50000 Hz is not plausible for a"),
    ("feeder.toml", lambda text: "f_nom = 50", 'feeder.toml: f_nom: unknown key; did you mean "f_nom_Hz"?'),
    ("feeder.toml", lambda text: "f_nom_Hz 50", "feeder.toml: not valid TOML"),
    ("inverter.csv", lambda text: "", 'inverter.csv: not a table of a feeder; did you mean "inverters.csv"?'),
]
"""File, its new text, and how the only problem begins that it makes."""


@pytest.mark.parametrize(("file", "change", "told"), CHANGED)
def test_a_file_with_a_problem_is_reported_once(
    folder: Path, file: str, change: Callable[[str], str | bytes], told: str
) -> None:
    """Whatever refers to it makes no problems of its own."""
    path = folder / file
    changed = change(path.read_text(encoding="utf-8") if path.exists() else "")
    path.write_bytes(changed if isinstance(changed, bytes) else changed.encode())

    (found,) = problems(folder)

    assert found.startswith(told), found


def test_a_missing_file_is_one_problem(folder: Path) -> None:
    """A missing table is one problem, not one for every reference into it; some a feeder need not have."""
    for name in ("source.csv", "capacitors.csv"):
        (folder / name).unlink()
    feeder = read_feeder(str(folder))
    for name in ("buses.csv", "line_configs.csv"):
        (folder / name).unlink()

    assert (feeder.source, feeder.capacitors) == (None, ())
    assert [problem.split(";")[0] for problem in problems(folder)] == [
        "buses.csv: no such file",
        "line_configs.csv: no such file",
    ]


@pytest.mark.parametrize(
    ("separator", "encoding", "comma"),
    [(";", "utf-8-sig", True), ("\t", "utf-16", True), (",", "utf-8-sig", False)],
    ids=["German CSV UTF-8", "German Unicode text", "CSV UTF-8"],
)
def test_tables_as_a_spreadsheet_saves_them_are_the_same_feeder(
    folder: Path, separator: str, encoding: str, comma: bool
) -> None:
    """Its separators, decimal commas, marks, line ends, and empty rows and columns."""
    before = read_feeder("microgrid123")
    for path in folder.glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
        if comma:
            rows = [[re.sub(r"^(-?\d+)\.(\d+)$", r"\1,\2", cell) for cell in row] for row in rows]
        empty = [[""] * len(rows[0])] * 14
        with path.open("w", newline="", encoding=encoding) as stream:
            csv.writer(stream, delimiter=separator).writerows([[*row, ""] for row in [*rows, *empty]])
    manifest = folder / "feeder.toml"
    if manifest.is_file():
        manifest.write_bytes(manifest.read_text(encoding="utf-8").encode("utf-16"))

    after = read_feeder(str(folder))

    assert (after.buses, after.lines, after.loads) == (before.buses, before.lines, before.loads)
    assert (after.inverters, after.transformers) == (before.inverters, before.transformers)


def test_unknown_names_get_the_choices(folder: Path) -> None:
    """A feeder, a set of loads, and the file that a feeder without any set needs."""
    with pytest.raises(FeederError, match='no such feeder and no such folder; did you mean "microgrid123"'):
        read_feeder("microgrid321")
    assert problems(folder, "man") == ('load set "man": no such set; there are event2, main',)
    for path in folder.glob("loads_*.csv"):
        path.unlink()
    assert problems(folder)[0].startswith("loads_main.csv: no such file; a feeder needs it, with the columns bus,")


@pytest.mark.parametrize(("file", "row", "what"), [
    ("loads_main.csv", "611,Y,P,10,5,0,0,0,0,", "a Y load"),
    ("inverters.csv", "more,GFM,611,MG2,50,0.01,0.05,", "an inverter"),
])  # fmt: skip
def test_ground_is_missing_wherever_a_delta_winding_leads(folder: Path, file: str, row: str, what: str) -> None:
    """A bus behind a line has no more ground than the winding's own: power to ground would return by nothing."""
    for name, line in (
        ("buses.csv", "611,ABC,0.48,passive,0,0,"),
        ("lines.csv", "more,610,611,ABC,1,10,,"),
        (file, row),
    ):
        with (folder / name).open("a") as stream:
            stream.write(f"{line}\n")

    (problem,) = problems(folder)

    assert f'bus "611" is behind a delta winding without ground, and {what} needs ground' in problem


@pytest.mark.parametrize("name", ["PV 2", "pv/2", "a*", "é", "x" * 65, "plant", "grid", "off"])
def test_a_name_that_cannot_go_on_the_wire_is_refused_in_the_table(folder: Path, name: str) -> None:
    """An inverter's name is a part of keys, and neither the plant's nor that of the grid's island."""
    edit(folder, "inverters.csv", 3, name=name)

    (found,) = problems(folder)

    assert re.match(rf'inverters\.csv row 3: name:? "{re.escape(name)}"', found), found
