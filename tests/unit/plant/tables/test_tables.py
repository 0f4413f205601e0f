import csv
import re
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import FeederError, feeders, read_feeder
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
    """Problems of a broken feeder."""
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
    """A feeder that did not change is the one read before; an edit is seen, and its problems are told each time."""
    first = read_feeder(str(folder))

    assert read_feeder(str(folder)) is first
    edit(folder, "lines.csv", 2, length_m="321")
    assert read_feeder(str(folder)).lines[0].length == 0.321
    edit(folder, "lines.csv", 2, length_m="-1")
    assert problems(folder) == problems(folder) != ()


def test_standard_feeder_has_the_published_load() -> None:
    """The standard feeder's spot loads add up to the published 3490 kW and 1920 kvar."""
    feeder = read_feeder("standard123")

    assert sum(sum(load.S) for load in feeder.loads) == 3490e3 + 1920e3j
    assert (len(feeder.buses), len(feeder.lines), len(feeder.loads), len(feeder.inverters)) == (130, 118, 85, 0)


def test_zones_of_the_microgrids_carry_their_loads() -> None:
    """Load set main has 760, 1252, 985 and 1195 kW in its four zones; MG1 has only inverters of its own."""
    assert zone_powers(read_feeder("microgrid123", "main")) == {
        "rest": 760e3 + 380e3j,
        "passive": 1252e3 + 660e3j,
        "MG2": 985e3 + 550e3j,
        "MG3": 1195e3 + 690e3j,
    }


def test_event2_load_set_drops_more() -> None:
    """Load set event2 has 1360 kW in the zone that event 2 drops, and 0.95 of the load in MG2 and MG3."""
    main, event2 = (zone_powers(read_feeder("microgrid123", load_set)) for load_set in ("main", "event2"))

    assert event2["passive"].real == 1360e3
    assert event2["MG2"] == pytest.approx(0.95 * main["MG2"])
    assert event2["MG3"] == pytest.approx(0.95 * main["MG3"])


def test_inverters_are_those_of_the_paper() -> None:
    """Three GFM of 600 kW and six GFL of 350 kW, 1 % and 5 % droop, three in each microgrid."""
    inverters = read_feeder("microgrid123").inverters

    assert [inverter.name for inverter in inverters] == [f"inv{i}" for i in range(1, 10)]
    assert {inverter.name for inverter in inverters if inverter.kind == "GFM"} == {"inv1", "inv4", "inv7"}
    assert {(inverter.kind, inverter.P_rated) for inverter in inverters} == {("GFM", 600e3), ("GFL", 350e3)}
    assert {(inverter.m_p, inverter.m_q) for inverter in inverters} == {(0.01, 0.05)}
    assert [inverter.microgrid for inverter in inverters] == ["MG1"] * 3 + ["MG2"] * 3 + ["MG3"] * 3


def test_quantities_are_in_si_units() -> None:
    """Tables give kV, kW, m; the feeder has V (line-to-neutral), W, km."""
    feeder = read_feeder("microgrid123")

    assert feeder.buses[0].V_nom == pytest.approx(4160 / 3**0.5)
    assert feeder.lines[0].length == pytest.approx(175 * 0.3048e-3)
    config = next(config for config in feeder.line_configs if config.name == "1")
    assert config.Z[0][1] == pytest.approx((0.1560 + 0.5017j) / 1.609344)
    assert config.Z[1][0] == config.Z[0][1]
    assert config.B[0][0] == pytest.approx(5.6765e-6 / 1.609344)


def test_folder_can_be_read_by_its_path(folder: Path) -> None:
    """A feeder outside of the package is read from the path of its folder."""
    feeder = read_feeder(str(folder), "event2")

    assert (feeder.name, feeder.load_set) == ("mine", "event2")
    assert feeder.loads == read_feeder("microgrid123", "event2").loads


FLOATING = 'bus "610" stands behind a delta winding without ground'
MISTAKES: list[tuple[str, int, dict[str, str], str]] = [
    ("buses.csv", 3, {"phases": "BX"}, 'phases must be letters out of A, B, C, each once (as "ABC" or "B"), got "BX"'),
    ("buses.csv", 136, {"bus": "162"}, 'bus "162": there is one of this name already; names must differ'),
    ("buses.csv", 136, {"bus": "999", "phases": "AB"}, 'bus "999" phase A, B: nothing connects it; '),
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
    ("switches.csv", 5, {"alias": "sw1_2"}, 'switch "sw1_2": there is one of this name already; names must differ'),
    ("switches.csv", 11, {"phases": "AB"}, 'bus "94" has no phase B; it has A'),
    (
        "regulators.csv",
        3,
        {"tap": "-161"},
        "tap, tap_step_pu: -0.00625 is not plausible for ",
    ),
    ("transformers.csv", 2, {"connection": "D-Yg"}, 'connection "D-Yg": no such connection of a transformer; '),
    ("transformers.csv", 2, {"X_percent": "0"}, "X_percent: the reactance of a transformer must be above 0, got 0 %"),
    ("loads_main.csv", 2, {"model": "ZIP"}, 'model "ZIP": no such load model; choose one of P, I, Z'),
    ("loads_main.csv", 3, {"P_c_kW": "5"}, 'bus "2" has a load on phase C but no phase C; it has B'),
    ("loads_main.csv", 3, {"connection": "D"}, 'bus "2" has a load between B and C but no phase C; it has B'),
    (
        "loads_main.csv",
        90,
        {"bus": "610"},
        f"{FLOATING}, and a Y load needs ground; ",
    ),
    (
        "inverters.csv",
        3,
        {"bus": "610"},
        f"{FLOATING}, and an inverter needs ground; ",
    ),
    (
        "capacitors.csv",
        7,
        {"bus": "610", "V_rated_kV_LN": "0.277"},
        f"{FLOATING}, and a capacitor bank needs ground; ",
    ),
    ("capacitors.csv", 3, {"Q_b_kvar": "50"}, 'bus "88" has no phase B; it has A'),
    ("inverters.csv", 11, {"spare": "no"}, 'spare "no": must be "yes" or empty'),
    ("inverters.csv", 3, {"bus": "160"}, 'bus "160" has inverter "inv1" on phase A already; only one'),
    ("inverters.csv", 3, {"bus": "94", "phases": "B"}, 'bus "94" has no phase B; it has A'),
    ("inverters.csv", 3, {"phases": "AB"}, 'phases "AB": must be "ABC" or "A" or "B" or "C" or empty'),
    ("inverters.csv", 3, {"bus": "160", "phases": "C"}, 'bus "160" has inverter "inv1" on phase C already; only one'),
    ("inverters.csv", 2, {"parameters": "regfm"}, 'parameters "regfm": no such set; did you mean "regfm_a1"?'),
    ("inverters.csv", 3, {"parameters": "regfm_a1"}, 'parameters "regfm_a1": a GFL has no model = "regfm_a1"'),
    ("source.csv", 3, {}, "a second source; a feeder has one at most"),
]


@pytest.mark.parametrize(("file", "row", "cells", "told"), MISTAKES, ids=[f"{m[0]}-{m[3][:40]}" for m in MISTAKES])
def test_problem_is_told(folder: Path, file: str, row: int, cells: dict[str, str], told: str) -> None:
    """Every kind of problem is told once, with file, row, value and what would be right, and drags no others behind."""
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


def test_missing_file_is_told_alone(folder: Path) -> None:
    """A missing table is one problem, not one for every reference into it."""
    (folder / "buses.csv").unlink()
    (folder / "line_configs.csv").unlink()

    assert [problem.split(";")[0] for problem in problems(folder)] == [
        "buses.csv: no such file",
        "line_configs.csv: no such file",
    ]


def test_missing_column_is_told_alone(folder: Path) -> None:
    """A missing column is told with the nearest one that is there."""
    lines = (folder / "lines.csv").read_text().replace("length_m", "length", 1)
    (folder / "lines.csv").write_text(lines)

    assert (
        'lines.csv: no column "length_m"; did you mean "length"? '
        "The columns are line, from_bus, to_bus, phases, config, length, origin, note"
    ) in problems(folder)


def test_misnamed_file_is_told(folder: Path) -> None:
    """A file that is no table of a feeder is a problem, for optional tables would else be missed silently."""
    (folder / "inverters.csv").rename(folder / "inverter.csv")

    assert problems(folder) == (
        'inverter.csv: not a table of a feeder; did you mean "inverters.csv"? The tables are buses.csv, lines.csv, '
        "line_configs.csv, switches.csv, regulators.csv, transformers.csv, capacitors.csv, inverters.csv, "
        "source.csv, elements.csv",
    )


def test_surplus_cells_are_told(folder: Path) -> None:
    """A row longer than the header, as an unquoted comma makes it, is a problem."""
    with (folder / "transformers.csv").open("a") as stream:
        stream.write("XFM2,61,610,D-D,150,1.27,2.72,no load, or little\n")

    assert problems(folder)[0].startswith("transformers.csv row 3: 1 cells more than the header has columns")


def test_unreadable_file_is_told(folder: Path) -> None:
    """A file that is no text is a problem of the feeder, not an exception of another kind."""
    (folder / "loads_main.csv").write_bytes(b"\xff\xfebus")

    assert problems(folder)[0].startswith("loads_main.csv: is damaged")


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


def test_a_table_of_a_code_page_is_told_in_one_line(folder: Path) -> None:
    """Excel's plain "CSV" has the letters of the computer's country."""
    text = (folder / "buses.csv").read_text()
    (folder / "buses.csv").write_bytes((text + "süd\n").encode("cp1252"))

    line = f"buses.csv: line {text.count(chr(10)) + 1} has byte 0xfc, which is not UTF-8 (Windows or Latin-1?)"
    assert [problem.split(";")[0] for problem in problems(folder) if "buses.csv" in problem] == [line]


def test_incomplete_matrix_is_told(folder: Path) -> None:
    """A line configuration that lacks an element of its matrix is a problem."""
    text = (folder / "line_configs.csv").read_text()
    (folder / "line_configs.csv").write_text("".join(x for x in text.splitlines(True) if not x.startswith("1,A,B")))

    assert problems(folder)[0].endswith('config "1" lacks element A-B; give the whole upper triangle')


def test_unknown_load_set_is_told_with_the_choice(folder: Path) -> None:
    """An unknown load set is told with those that exist."""
    assert problems(folder, "man") == ('load set "man": no such set; there are event2, main',)


def test_feeder_without_load_sets_is_told(folder: Path) -> None:
    """A feeder without any load table is told which file it needs."""
    for path in folder.glob("loads_*.csv"):
        path.unlink()

    assert problems(folder)[0].startswith("loads_main.csv: no such file; a feeder needs it, with the columns bus,")


def test_unknown_feeder_is_told_with_the_choice() -> None:
    """An unknown feeder is told with those that come with the package."""
    with pytest.raises(
        FeederError, match="no such feeder and no such folder; there are ieee34, microgrid123, standard123"
    ):
        read_feeder("microgrid321")

    assert feeders() == ("ieee34", "microgrid123", "standard123")


def test_feeder_fed_by_inverters_only_needs_no_source(folder: Path) -> None:
    """Tables that a feeder does not need may be missing: here no substation, no capacitor, no transformer row."""
    (folder / "source.csv").unlink()
    (folder / "capacitors.csv").unlink()

    feeder = read_feeder(str(folder))

    assert feeder.source is None
    assert feeder.capacitors == ()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("f_nom_Hz = 50000", "feeder.toml: f_nom_Hz: 50000 Hz is not plausible for a nominal frequency (16 to 400 Hz)"),
        ('f_nom_Hz = "50"', 'feeder.toml: f_nom_Hz: must be a number, got "50"; write 50'),
        ("f_nom = 50", "feeder.toml: f_nom: unknown key; write f_nom_Hz, in hertz"),
        ("f_nom_Hz 50", "feeder.toml: not valid TOML"),
    ],
)
def test_a_manifest_with_a_problem_is_told(folder: Path, text: str, told: str) -> None:
    """File, key, value with its unit, and what would be right."""
    (folder / "feeder.toml").write_text(text, encoding="utf-8")

    assert problems(folder)[0].startswith(told)


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

    assert f'bus "611" stands behind a delta winding without ground, and {what} needs ground' in problem


IMPLAUSIBLE: list[tuple[str, int, dict[str, str], str]] = [
    ("inverters.csv", 2, {"P_rated_kW": "600000"}, "did you mean 600 (600000 W)?"),
    ("inverters.csv", 2, {"P_rated_kW": "0.6"}, "did you mean 600 (0.6 MW)?"),
    ("inverters.csv", 2, {"m_p_pu": "1"}, "1 pu is not plausible for a P-f droop (0.001 to 0.2 pu); did you mean 0.01"),
    ("inverters.csv", 2, {"m_q_pu": "5"}, "did you mean 0.05 (5 %)?"),
    ("inverters.csv", 2, {"m_p_pu": "1e-9"}, "1e-09 pu is not plausible for a P-f droop"),
    ("buses.csv", 3, {"V_nom_kV_LL": "4160"}, "did you mean 4.16 (4160 V)?"),
    ("lines.csv", 4, {"length_m": "1e9"}, "1e+09 m is not plausible for the length of a line"),
    ("lines.csv", 4, {"length_m": "0.0914"}, "did you mean 91.4 (0.0914 km)?"),
    ("line_configs.csv", 2, {"R_ohm_per_km": "284"}, "did you mean 0.284 (284 ohm/1000 km)?"),
    ("line_configs.csv", 3, {"X_ohm_per_km": "2.3"}, 'config "1" has an X matrix that no line has'),
    ("loads_main.csv", 2, {"P_a_kW": "40000"}, "did you mean 40 (40000 W)?"),
    ("loads_main.csv", 2, {"Q_a_kvar": "-20000"}, "did you mean -20 (-20000 var)?"),
    ("capacitors.csv", 3, {"Q_a_kvar": "50000"}, "did you mean 50 (50000 var)?"),
    (
        "capacitors.csv",
        3,
        {"V_rated_kV_LN": "4.16"},
        "4.16 kV is not plausible for a capacitor bank at a bus of 2.402 kV ",
    ),
    ("transformers.csv", 2, {"S_rated_kVA": "150000"}, "did you mean 150 (150000 VA)?"),
    ("transformers.csv", 2, {"X_percent": "0.0272"}, "did you mean 2.72 (0.0272 pu)?"),
    (
        "regulators.csv",
        3,
        {"tap": "100"},
        "tap, tap_step_pu: 1.625 is not plausible for the ratio of a regulator",
    ),
    ("source.csv", 2, {"V_pu": "100"}, "did you mean 1 (100 %)?"),
    ("source.csv", 2, {"angle_deg": "1e6"}, "1e+06 deg is not plausible for the angle of the substation"),
]


@pytest.mark.parametrize(("file", "row", "cells", "told"), IMPLAUSIBLE, ids=[f"{m[0]}-{m[2]}" for m in IMPLAUSIBLE])
def test_a_number_off_by_its_unit_is_refused_with_what_was_meant(
    folder: Path, file: str, row: int, cells: dict[str, str], told: str
) -> None:
    """A number that is a thousand times too large or small is refused where it stands, not found by a solver later."""
    edit(folder, file, row, **cells)

    found = [problem for problem in problems(folder) if "between buses of" not in problem]

    assert len(found) == 1, found
    assert told in found[0]
    assert found[0].startswith(file)


@pytest.mark.parametrize("name", ["PV 2", "pv/2", "a*", "é", "x" * 65, "plant", "grid", "off"])
def test_a_name_that_cannot_go_on_the_wire_is_refused_in_the_table(folder: Path, name: str) -> None:
    """An inverter's name is a part of keys, and neither the plant's nor that of the grid's island."""
    edit(folder, "inverters.csv", 3, name=name)

    (found,) = problems(folder)

    assert re.match(rf'inverters\.csv row 3: name:? "{re.escape(name)}"', found), found


def test_control_characters_in_a_name_are_refused(folder: Path) -> None:
    """A name is printed to terminals, so it has no escape sequences in it."""
    edit(folder, "inverters.csv", 3, microgrid="MG\x1b[31m1")

    (found,) = problems(folder)

    assert found.startswith("inverters.csv row 3: microgrid ")
    assert "\x1b" not in found


def test_a_missing_line_is_told_with_the_buses_it_cuts_off(folder: Path) -> None:
    """A feeder is one network when all its switches are closed; what hangs on nothing is named."""
    text = (folder / "lines.csv").read_text()
    (folder / "lines.csv").write_text("".join(x for x in text.splitlines(True) if not x.startswith("L67_72,")))

    (found,) = problems(folder)

    assert found.startswith("buses.csv: 23 buses are not connected with the substation at bus 150: 72 phase B, C, 73, ")
    assert "(with inv4, inv5, inv6)" in found
    assert "a line, switch, regulator or transformer is missing" in found


def test_a_line_that_lacks_a_phase_is_told(folder: Path) -> None:
    """Phases are followed one by one: B and C of what lies behind a single-phase line are not fed."""
    lines = (folder / "lines.csv").read_text()
    assert "L29_30,29,30,ABC,2," in lines
    (folder / "lines.csv").write_text(lines.replace("L29_30,29,30,ABC,2,", "L29_30,29,30,A,9,"))

    (found,) = problems(folder)

    assert "2 buses are not connected with the substation at bus 150: 30 phase B, C, 250 phase B, C;" in found


@pytest.mark.parametrize("feeder", feeders())
def test_the_feeders_that_come_with_the_package_are_plausible(feeder: str) -> None:
    """No bound refuses the feeders of the package, in any of their load sets."""
    sets = [path.stem.removeprefix("loads_") for path in (DATA / feeder).glob("loads_*.csv")]

    assert all(read_feeder(feeder, load_set).buses for load_set in sets)


def test_a_feeder_without_buses_is_told_once(folder: Path) -> None:
    """An empty table of buses is one problem, not one for every reference into it."""
    (folder / "buses.csv").write_text("bus,phases,V_nom_kV_LL\n")

    assert problems(folder) == ("buses.csv: has no rows; a feeder needs at least one bus",)


def test_a_column_given_twice_is_told_once(folder: Path) -> None:
    """Which of two columns of one name counts, nobody knows."""
    text = (folder / "lines.csv").read_text().replace("origin,note", "length_m,note", 1)
    (folder / "lines.csv").write_text(text)

    assert problems(folder) == ('lines.csv: column "length_m" stands there twice; keep one',)
