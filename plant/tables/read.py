"""From a feeder's folder to a checked `Tables`; all of its problems come at once."""

from __future__ import annotations

import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from gridpeers.plant.equipment import PHASES, Load, Tables
from gridpeers.plant.equipment.connectivity import Connectivity, buses_without_ground, by_bus
from gridpeers.plant.equipment.neutrals import neutrals_by_bus
from gridpeers.plant.tables import branches, shunts
from gridpeers.plant.tables.feeder_columns import LOAD_SETS, TABLES, Manifest
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.text_file import TextFileError, text_of
from gridpeers.wire.wording import InputError, counted, first_of, suggestion

MANIFEST = "feeder.toml"
DATA = Path(__file__).parents[1] / "data"  # folder of the feeders that come with the package
KEPT = 8  # feeders that are kept as they were read, by the bytes of their files
_SHOWN = 24  # so many buses that are cut off are named


class FeederError(InputError):
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


def is_folder(path: Path) -> bool:
    """Whether there is a folder; a name that is too long, or cannot be, names none."""
    try:
        return path.is_dir()
    except OSError:
        return False


def read_feeder(feeder: str, load_set: str = "main") -> Tables:
    """Read all tables of a feeder and check them.

    `feeder`: name of a feeder in `plant/data`, or the path of a folder of the same layout; `load_set`: which loads:
    "main" reads loads_main.csv. FeederError lists all that is wrong.

    >>> feeder = read_feeder("microgrid123", "main")
    >>> len(feeder.buses), [inverter.name for inverter in feeder.inverters if inverter.kind == "GFM"]
    (134, ['inv1', 'inv4', 'inv7'])
    """
    folder = DATA / feeder if feeder in feeders() else Path(feeder)
    if not is_folder(folder):
        near = suggestion(feeder, feeders(), "feeders that come with gridpeers")
        raise FeederError(feeder, (f'feeder "{feeder}": no such feeder and no such folder; {near}',))
    paths = sorted([*folder.glob("*.csv"), *folder.glob(MANIFEST)])
    contents = tuple((path.name, path.read_bytes() if path.is_file() else b"") for path in paths)
    return _read_tables(folder, feeder, load_set, contents)


@lru_cache(KEPT)
def _read_tables(folder: Path, feeder: str, load_set: str, contents: tuple[tuple[str, bytes], ...]) -> Tables:
    """Read and check all tables; with other `contents` of the files a folder is read anew."""
    problems = [
        f"{file}: not a table of a feeder; {suggestion(file, TABLES, 'tables')}"
        for file, _ in contents
        if file not in TABLES and file != MANIFEST and not file.startswith(tuple(LOAD_SETS))
    ]
    buses = branches.BusTable(folder, problems)
    configs = branches.read_line_configs(buses)
    lines = branches.read_lines(buses, configs)
    switches = branches.read_switches(buses)
    regulators = branches.read_regulators(buses)
    transformers = branches.read_transformers(buses)
    buses.floating = buses_without_ground(transformers, lines, [*switches, *regulators])
    sets, of_parts = load_sets(folder), f"load_parts_{load_set}.csv"
    loads: tuple[Load, ...] = ()
    if load_set in sets or not sets:
        loads = shunts.read_loads(buses, f"loads_{load_set}.csv", required=not (folder / of_parts).is_file())
    else:
        problems.append(f'load set "{load_set}": no such set; there are {", ".join(sets)}')
    elements = branches.read_elements(buses)
    load_parts = shunts.read_load_parts(buses, of_parts)
    capacitors = shunts.read_capacitors(buses)
    powers = [*(S for load in loads for S in load.S), *(part.S for part in load_parts)]
    demand = sum(S.real for S in powers if S.real > 0.0)
    neutrals = neutrals_by_bus(buses.rows, load_parts, elements, switches)
    inverters = shunts.read_inverters(buses, demand, neutrals)
    source = shunts.read_source(buses)
    manifest, found = read_table(Manifest, _manifest(folder / MANIFEST, problems))
    problems += [f"{MANIFEST}: {path}: {text}" for path, text in found]
    whole = Tables(
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
        f_nom=manifest.f_nom_Hz,
        elements=elements,
        load_parts=load_parts,
    )
    if not problems and whole.buses:
        # After other problems this would only repeat them: a misnamed end leaves the right bus unconnected.
        _report_unconnected(whole, problems)
    if problems:
        raise FeederError(feeder, tuple(problems))
    return whole


def _manifest(path: Path, problems: list[str]) -> dict[str, Any]:
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


def _report_unconnected(feeder: Tables, problems: list[str]) -> None:
    """Note every node that is cut off even with all switches closed: a feeder is one network, in each phase."""
    inverters = (*feeder.inverters, *feeder.spares)
    of_three = [row.bus for row in inverters if len(row.phases) > 1]
    of_three += [bus.name for bus in feeder.buses if set(PHASES) <= set(bus.phases)] if inverters else []
    whole = [*([feeder.source.bus] if feeder.source else []), *of_three][:1]
    parts = Connectivity(feeder).parts(whole=whole)
    main = next((part for part in parts if whole and (whole[0], "A") in part), max(parts, key=len))
    for part in by_bus(part for part in parts if part is not main):
        names, shown = [], []
        for bus in feeder.buses:
            if phases := [phase for phase in bus.phases if (bus.name, phase) in part]:
                names.append(bus.name)
                shown.append(bus.name + ("" if len(phases) == len(bus.phases) else f" phase {', '.join(phases)}"))
        there = ", ".join(row.name for row in inverters if row.bus in names)
        rest = f"the substation at bus {whole[0]}" if feeder.source else "the rest"
        problems.append(
            f"buses.csv: {counted(len(names), 'bus', 'buses')} not connected with {rest}: {first_of(shown, _SHOWN)}"
            + (f" (with {there})" if there else "")
            + "; a line, switch, regulator or transformer is missing, or lacks a phase"
        )
