"""From a feeder's folder to a checked `Feeder`; all of its problems come at once."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import buses_without_ground
from gridpeers.plant.equipment.neutrals import neutrals_by_bus
from gridpeers.plant.tables.branches import (
    read_line_configs,
    read_lines,
    read_regulators,
    read_switches,
    read_transformers,
)
from gridpeers.plant.tables.buses import BusTable, report_unconnected
from gridpeers.plant.tables.csv_table import required_columns
from gridpeers.plant.tables.feeder_columns import LOAD_SETS, TABLES, LoadColumns, Manifest
from gridpeers.plant.tables.imported import read_elements, read_load_parts
from gridpeers.plant.tables.parameter_sets import read_parameter_sets
from gridpeers.plant.tables.shunts import read_capacitors, read_inverters, read_loads, read_source
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.text_file import TextFileError, text_of
from gridpeers.wire.wording import suggestion

MANIFEST = "feeder.toml"


def read_f_nom(folder: Path, problems: list[str]) -> float:
    """Return the nominal frequency (Hz) of a feeder; without a file, 60 Hz."""
    manifest, found = read_table(Manifest, _tables(folder / MANIFEST, problems))
    problems += [f"{MANIFEST}: {path}: {text}" for path, text in found]
    return manifest.f_nom_Hz


def _tables(path: Path, problems: list[str]) -> dict[str, Any]:
    try:
        return tomllib.loads(text_of(path.read_bytes()))
    except FileNotFoundError:
        return {}
    except OSError as error:
        problems.append(f"{path.name}: cannot be read: {error.strerror}")
    except TextFileError as error:
        problems.append(f"{path.name}: {error}")
    except (ValueError, RecursionError) as error:
        problems.append(f"{path.name}: not valid TOML: {error}")
    return {}


DATA = Path(__file__).parents[1] / "data"  # folder of the feeders that come with the package

KEPT = 8
"""Feeders that are kept as they were read, by the bytes of their files: to read one again is a tenth of the work."""


class FeederError(ValueError):
    """A feeder that cannot be used, with everything that is wrong with it.

    `problems`: one sentence each: file, row (the header is row 1), value, what would be right.
    """

    def __init__(self, feeder: str, problems: tuple[str, ...]) -> None:
        self.problems = problems
        count = "a problem" if len(problems) == 1 else f"{len(problems)} problems"
        super().__init__(f'feeder "{feeder}" has {count}:\n' + "\n".join(f"  {problem}" for problem in problems))


def feeders() -> tuple[str, ...]:
    return tuple(sorted(path.name for path in DATA.iterdir() if path.is_dir() and path.name != "__pycache__"))


def load_sets(folder: Path) -> tuple[str, ...]:
    """Names of the load sets in a feeder's folder: "main" for loads_main.csv."""
    return tuple(sorted({path.stem.removeprefix(kind) for kind in LOAD_SETS for path in folder.glob(f"{kind}*.csv")}))


def read_feeder(feeder: str, load_set: str = "main") -> Feeder:
    """Read all tables of a feeder and check them.

    `feeder`: name of a feeder in `plant/data`, or the path of a folder of the same layout; `load_set`: which loads:
    "main" reads loads_main.csv.

    FeederError if anything is wrong; it lists all of it.

    >>> feeder = read_feeder("microgrid123", "main")
    >>> len(feeder.buses), [inverter.name for inverter in feeder.inverters if inverter.kind == "GFM"]
    (134, ['inv1', 'inv4', 'inv7'])
    """
    folder = _folder(feeder)
    paths = sorted([*folder.glob("*.csv"), *folder.glob(MANIFEST)])
    contents = tuple((path.name, path.read_bytes() if path.is_file() else b"") for path in paths)
    return _read_tables(folder, feeder, load_set, contents)


@lru_cache(KEPT)
def _read_tables(folder: Path, feeder: str, load_set: str, contents: tuple[tuple[str, bytes], ...]) -> Feeder:
    """Read and check all tables; with other `contents` of the files a folder is read anew."""
    problems: list[str] = []
    _report_strange_files(folder, problems)
    buses = BusTable(folder, problems)
    configs = read_line_configs(buses)
    lines = read_lines(buses, configs)
    switches = read_switches(buses)
    regulators = read_regulators(buses)
    transformers = read_transformers(buses)
    buses.mark_floating(buses_without_ground(transformers, lines, [*switches, *regulators]))
    sets = load_sets(folder)
    if load_set in sets:
        needed = not (folder / f"load_parts_{load_set}.csv").is_file()
        loads = read_loads(buses, f"loads_{load_set}.csv", required=needed)
    else:
        loads, columns = (), ", ".join(required_columns(LoadColumns))
        problems.append(
            f'load set "{load_set}": no such set; there are {", ".join(sets)}'
            if sets
            else f"loads_{load_set}.csv: no such file; a feeder needs it, with the columns {columns}"
        )
    elements = read_elements(buses)
    load_parts = read_load_parts(buses, f"load_parts_{load_set}.csv")
    capacitors = read_capacitors(buses)
    parameter_sets = read_parameter_sets(buses)
    demand = sum(
        S.real for S in (*(S for load in loads for S in load.S), *(part.S for part in load_parts)) if S.real > 0.0
    )
    neutrals = neutrals_by_bus(buses.rows, load_parts, elements, switches)
    inverters = read_inverters(buses, demand, neutrals, parameter_sets)
    source = read_source(buses)
    f_nom = read_f_nom(folder, problems)
    found = Feeder(
        name=folder.name,
        load_set=load_set,
        buses=buses.rows,
        lines=lines,
        line_configs=tuple((configs or {}).values()),
        switches=switches,
        loads=loads,
        capacitors=capacitors,
        regulators=regulators,
        transformers=transformers,
        inverters=tuple(row for row in inverters if not row.spare),
        spares=tuple(row for row in inverters if row.spare),
        source=source,
        f_nom=f_nom,
        elements=elements,
        load_parts=load_parts,
        parameter_sets=parameter_sets or {},
    )
    if not problems and found.buses:
        # After other problems this would only repeat them: a misnamed end leaves the right bus unconnected.
        report_unconnected(found, buses, problems)
    if problems:
        raise FeederError(feeder, tuple(problems))
    return found


def is_folder(path: Path) -> bool:
    """Whether there is a folder; a name that is too long, or cannot be, names none."""
    try:
        return path.is_dir()
    except OSError:
        return False


def _folder(feeder: str) -> Path:
    if feeder in feeders():
        return DATA / feeder
    folder = Path(feeder)
    if is_folder(folder):
        return folder
    raise FeederError(
        feeder,
        (f'feeder "{feeder}": no such feeder and no such folder; there are {", ".join(feeders())}',),
    )


def _report_strange_files(folder: Path, problems: list[str]) -> None:
    for path in sorted(folder.glob("*.csv")):
        if path.name not in TABLES and not path.name.startswith(tuple(LOAD_SETS)):
            problems.append(f"{path.name}: not a table of a feeder; {suggestion(path.name, TABLES, 'tables')}")
