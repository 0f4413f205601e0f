"""Scenarios in Python: load, build, change, check and run them."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from enum import Enum
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, overload

from gridpeers.scenarios.schema import scenario_model as model
from gridpeers.scenarios.schema.loading import check_tables, find_scenario, read_toml
from gridpeers.scenarios.schema.scenario_errors import Problems, ScenarioError
from gridpeers.wire.wording import counted

if TYPE_CHECKING:
    from typing import Unpack

    from gridpeers.plant.equipment import Tables
    from gridpeers.runs.result import Result, Results
    from gridpeers.runs.running import How
    from gridpeers.scenarios.run_request import Driver
    from gridpeers.scenarios.sweep.paths import Tree


def as_scenario(it: Scenario | str | Path) -> Scenario:
    """Return a scenario that may be given by its name or path."""
    if isinstance(it, Scenario):
        return it
    if isinstance(it, str | Path):
        return load(it)
    raise ScenarioError([f"needs a scenario, its name or its path, got {it!r:.60}"])


def load(name_or_path: str | Path) -> Scenario:
    """Read and check a scenario of the catalogue (`gridpeers.catalogue()` lists them) or a scenario file.

    A ScenarioError lists every problem of the file and of its feeder.

    >>> load("islanding")
    <Scenario islanding: cases I, II, III, IV; 2 events; 7 s; 9 inverters on 134 buses>
    """
    path = find_scenario(str(name_or_path))
    text, tree = read_toml(path)
    return Scenario._of(tree, path, text, frozenset(), Problems(path.name, text))  # noqa: SLF001  of this file


class Scenario:
    """An experiment: a feeder with inverters, events, and cases of control to compare.

    The arguments are the tables of a scenario file (`gridpeers doc scenario`); relative paths start at the working
    directory. A scenario is checked when it is made, and never changes.

    >>> Scenario(
    ...     name="mine",
    ...     time={"end_s": 2.0},
    ...     event=[{"label": "islanding", "t_s": 1.0, "open": ["13-152"]}],
    ...     case={"ring": {"secondary": "all", "graph": "ring"}},
    ... )
    <Scenario mine: case ring; 1 event; 2 s; 9 inverters on 134 buses>
    """

    def __init__(self, **tables: Any) -> None:
        problems = Problems("Scenario(...)")
        tree: Tree = {}
        for key, value in tables.items():
            try:
                tree[key] = plain(value)
            except ValueError as error:
                problems.add(key, str(error))
        problems.raise_if_any()
        self._set(tree, Path("scenario.toml").absolute(), "", frozenset(), problems)

    @classmethod
    def _of(cls, tree: Tree, path: Path, text: str, changed: frozenset[str], problems: Problems) -> Scenario:
        """Make a scenario of the tables of a file; `changed` keys have no line in it."""
        self = cls.__new__(cls)
        self._set(tree, path, text, changed, problems)
        return self

    def _set(self, tree: Tree, path: Path, text: str, changed: frozenset[str], problems: Problems) -> None:
        self._tree, self._path, self._text, self._changed = tree, path, text, changed
        self._spec, feeder = check_tables(tree, path, problems)
        problems.raise_if_any()
        assert feeder is not None
        self._feeder = feeder

    def replace(self, changes: Mapping[str, Any]) -> Scenario:
        """Return a scenario with changed values, given by dotted paths of keys such as `gains.k_p` or `event[0].t_s`.

        A table replaces a whole table, or makes a new case: `{"case.V": {...}}`. None removes a key, so its default
        applies. A class or a function becomes its reference `module:Name`.

        >>> load("islanding").replace({"gains.k_p": 0.001, "case.IV.graph": "ring"}).cases["IV"].graph
        'ring'
        >>> load("islanding").replace({"gains.k_p": "much", "case.VI.graph": "ring"})
        Traceback (most recent call last):
            ...
        gridpeers.ScenarioError: replace: case.VI.graph: there is no case.VI; ...
        replace: gains.k_p: must be a number, got "much"
        """
        from gridpeers.scenarios.sweep.paths import PathError, put, remove  # with numpy, which a run starts without

        tree, changed = copy.deepcopy(self._tree), self._changed | frozenset(changes)
        problems = Problems(self._path.name if self._text else "Scenario(...)", self._text, changed=changed)
        for path, value in changes.items():
            try:
                if value is None:
                    remove(tree, path)
                else:
                    put(tree, path, plain(value))
            except (PathError, ValueError) as error:
                problems.add(path, str(error))
        return self._of(tree, self._path, self._text, changed, problems)

    def check(self) -> tuple[str, ...]:
        """Return notes on parts that events de-energise or overload, and on graphs too sparse for a law among liars.

        A ScenarioError says why the plant cannot start.
        """
        from gridpeers.rooms import ROOMS
        from gridpeers.scenarios.schema.loading import start_problem
        from gridpeers.scenarios.schema.supply import supply_notes

        if problem := start_problem(self._spec, self._feeder):
            raise ScenarioError([f"{self.name}: the plant cannot start: {problem}"])
        robustness_notes = ROOMS.resolve("robustness_notes")
        return (*supply_notes(self._spec, self._feeder), *robustness_notes(self._spec, self._feeder))

    @overload
    def run(self, case: str, driver: Driver = ..., **how: Unpack[How]) -> Result: ...
    @overload
    def run(
        self, case: list[str] | tuple[str, ...] | None = ..., driver: Driver = ..., **how: Unpack[How]
    ) -> Results: ...
    def run(
        self, case: str | list[str] | tuple[str, ...] | None = None, driver: Driver = "inprocess", **how: Unpack[How]
    ) -> Result | Results:
        """Run one case and return a `Result`; run a list of cases, or all by default, and return `Results`.

        Both drivers give the same bytes in simulated time. Raise ScenarioError for an unknown case, driver or clock,
        BrokenRunError with the place of the log if a case breaks, and FolderError if the folder is not empty or cannot
        be written.

        Parameters
        ----------
        case : str, list of str or None
            Name of a case, several names, or None for all cases.
        driver : {"inprocess", "processes"}
            One process for all, or a plant process and processes of agents over Zenoh.
        keys : str or Path, optional
            Folder with certificates (`gridpeers keys init`) for mutual TLS between processes. Without it links are
            open, on the loopback.
        processes : int
            Number of processes that the agents share; 0 gives each agent its own. An agent that the scenario starts,
            stops, kills or pauses always has its own.
        clock : {"simulated", "realtime"}
            Simulated time, or real time, which needs the driver "processes".
        speed : float
            In real time: seconds of the run per second, from 0.1 to 50.
        strict : bool
            In real time: break the run when it cannot keep pace.
        progress : Callable[[str, float, float], None], optional
            Gets the name, the time reached (s) and the end (s) of a case while it runs.
        folder : str or Path, optional
            New or empty folder for the files and figures. Without it the files disappear with the results.
        """
        from gridpeers.runs.running import run

        results = run(self, [case] if isinstance(case, str) else case, driver, **how)
        return results[case] if isinstance(case, str) else results

    @property
    def name(self) -> str:
        """Name of the scenario, and of its run folders."""
        return self._spec.name

    @property
    def title(self) -> str:
        """Title of the scenario, one line."""
        return self._spec.title

    @property
    def cases(self) -> dict[str, model.Case]:
        """Cases by name."""
        return dict(self._spec.cases)

    @property
    def events(self) -> tuple[model.Event, ...]:
        """Events in the order of time."""
        return self._spec.events

    @property
    def feeder(self) -> Tables:
        """Tables of the feeder."""
        return self._feeder

    @property
    def inverters(self) -> tuple[str, ...]:
        """Names of the inverters; those that join later come last."""
        from gridpeers.scenarios.schema.participants import inverters_of

        return tuple(row.name for row in inverters_of(self._spec, self._feeder))

    @property
    def spec(self) -> model.ScenarioModel:
        """All keys as typed values, defaults included (`gridpeers.scenarios.schema.scenario_model`)."""
        return self._spec

    @property
    def tables(self) -> Tree:
        """Copy of the tables as written, without defaults."""
        return copy.deepcopy(self._tree)

    @property
    def path(self) -> Path:
        """File of the scenario; relative paths start in its folder."""
        return self._path

    def to_toml(self) -> str:
        """Return the text of a scenario file with every key, defaults included."""
        from gridpeers.scenarios.schema.scenario_writing import to_toml

        return to_toml(self._spec, {})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._spec == other._spec and self._feeder == other._feeder

    __hash__ = None  # type: ignore[assignment]

    @property
    def extent(self) -> str:
        """Cases, and numbers of events, seconds, inverters and buses, in words."""
        cases, events, feeder = self._spec.cases, len(self._spec.events), self._feeder
        return (
            f"case{'s' * (len(cases) != 1)} {', '.join(cases)}; {counted(events, 'event')}; "
            f"{self._spec.time.end_s:g} s; {len(self.inverters)} inverters on {len(feeder.buses)} buses"
        )

    def __repr__(self) -> str:
        return f"<Scenario {self.name}: {self.extent}>"


def plain(value: Any) -> Any:
    """Return a value as TOML has it; raise ValueError if a scenario file cannot hold it.

    numpy's scalars and arrays become numbers and lists, and a class or a function becomes its reference `module:Name`.

    >>> import collections
    >>> plain({"links": (("inv1", "inv4"),), "law": collections.Counter})
    {'links': [['inv1', 'inv4']], 'law': 'collections:Counter'}
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if isinstance(value, str | PurePath):
        return str(value)
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, Mapping):
        return {plain(str(key)): plain(below) for key, below in value.items()}
    if isinstance(value, set | frozenset):
        value = sorted(value, key=lambda it: (str(type(it)), it))
    if isinstance(value, list | tuple | range):
        return [plain(item) for item in value]
    if hasattr(value, "__qualname__") and hasattr(value, "__module__"):
        if "<" in value.__qualname__:
            raise ValueError(
                f"{value.__qualname__} is defined inside a function, so it cannot be imported; define it at the top "
                "of a module or of the notebook"
            )
        return f"{value.__module__}:{value.__qualname__}"
    if callable(getattr(value, "tolist", None)):  # numpy and pandas, which need not be imported for this
        return plain(value.tolist())
    raise ValueError(
        f"a scenario cannot hold a value of type {type(value).__name__}; give a number, text, list or table"
    )
