"""Shared parts of all commands: exit codes, a scenario by its name, and how a command ends by an error or a signal."""

from __future__ import annotations

import re
import signal
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from gridpeers.scenarios.console import terminal as terminal

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Feeder
    from gridpeers.plant.tables import FeederError
    from gridpeers.scenarios.schema import ScenarioError, ScenarioModel

Dask = Annotated[
    str,
    typer.Option("--dask", metavar="ADDRESS", help="Dask scheduler to use instead, e.g. tcp://10.0.0.1:8786."),
]

ScenarioName = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="A name that `gridpeers list` shows, or the path of a file.")
]
"""Argument of every command that takes a scenario."""

PASSED, CLAIM_FAILED, BAD_INPUT, BROKEN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143


OPTIONS = {
    "plant.simulator": "--plant",
    "plant.load_set": "--load-set",
    "plant.helics.broker": "--broker",
    "plant.helics.federates": "--federates",
    "plant.helics.name": "--name",
}
"""Options that change a key of the scenario, by this key."""


def load(name: str, changes: Mapping[str, Any] = MappingProxyType({})) -> tuple[ScenarioModel, Feeder]:
    """Read and check a scenario, with keys changed by the command line, and its feeder; or end with every problem."""
    from gridpeers.scenario import load as load_face
    from gridpeers.scenarios.schema import ScenarioError
    from gridpeers.wire.driver.command_line import command_line

    if not name:
        fail([f"no scenario was named; `{command_line('list')}` shows those of the catalogue"], BAD_INPUT)

    try:
        scenario = load_face(name)
        if changes:
            scenario = scenario.replace(changes)
        return scenario.spec, scenario.feeder
    except ScenarioError as error:
        refuse(error)


def refuse(error: ScenarioError | FeederError) -> NoReturn:
    """End with every problem in a file, or of an option that changes a key of it."""
    problems = list(error.problems)
    for key, option in OPTIONS.items():
        problems = [re.sub(rf"^replace: {re.escape(key)}:", f"{option}:", problem) for problem in problems]
    head = [] if len(problems) == 1 else [f"{len(problems)} problems:"]
    fail([*head, *problems], BAD_INPUT)


def check_choice(option: str, kind: str, value: str, known: Collection[str]) -> None:
    """End with the nearest word if a value is none of those that an option takes."""
    from gridpeers.wire.wording import suggestion

    if value not in known:
        fail([f'{option}no {kind} "{value}"; {suggestion(value, tuple(known), f"{kind}s")}'], BAD_INPUT)


def chosen(spec: ScenarioModel, case: str | None, seed: int | None) -> ScenarioModel:
    """Return the scenario with the cases and the seed of the command line."""
    import msgspec

    from gridpeers.runs.choices import with_cases
    from gridpeers.scenarios.schema import ScenarioError

    if case is not None:
        names = [name.strip() for name in case.split(",") if name.strip()]
        try:
            spec = with_cases(spec, names or [case], option="--case: ")
        except ScenarioError as error:
            refuse(error)
    return spec if seed is None else msgspec.structs.replace(spec, seed=seed)


RUN = {
    **dict.fromkeys(("numpy", "scipy", "numba", "threadpoolctl"), "the plant"),
    **dict.fromkeys(("mcap", "lz4", "zstandard", "msgpack"), "the record of a run"),
    "matplotlib": "the figures",
}
"""Packages that a run needs in any driver, and what for."""


def require(modules: dict[str, str], install: str = "") -> None:
    """End with a clear line, and with advice, if a package that is needed is missing."""
    from importlib.util import find_spec

    from gridpeers.wire.wording import DISTRIBUTIONS, requirement

    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        packages = {name: DISTRIBUTIONS.get(name, name) for name in missing}
        lines = [f"{packages[name]} is not installed; it is needed for {modules[name]}" for name in missing]
        again = f"install what is missing: pip install {' '.join(map(requirement, missing))}"
        fail([*lines, install or again], BAD_INPUT)


def require_loadable(module: str, user: str) -> None:
    """End with a clear line if a package with a library of its own, an extra by its name, is missing or damaged."""
    import subprocess

    from gridpeers.wire.wording import damaged

    require({module: user}, f"install it: pip install 'gridpeers[{module}]'")
    done = subprocess.run([sys.executable, "-P", "-c", f"import {module}"], capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.strip().rpartition("\n")[2] or f"exit status {done.returncode}"
        fail([damaged(module, reason, user)], BAD_INPUT)


def fail(lines: list[str], code: int) -> NoReturn:
    """End the command with lines on standard error; characters that cannot be printed are escaped."""
    from gridpeers.wire.wording import printable

    for line in lines:
        print("gridpeers: " + "\n".join(map(printable, line.split("\n"))), file=sys.stderr)
    raise SystemExit(code)


@contextmanager
def interruptible() -> Iterator[None]:
    """Have SIGTERM, and a terminal that goes away, end what is inside as Ctrl-C does: by `KeyboardInterrupt`.

    Signals within a second are one request, those of Ctrl-C too, which `timeout` passes on twice.
    """
    from gridpeers.scenarios.results.run_files import TerminatedError
    from gridpeers.wire.driver.ending import StopSignal

    terminate, numbers = StopSignal(TerminatedError), [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else a shell has it ignored, or another has it
        numbers.append(signal.SIGINT)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # else nohup has asked that the run outlives its terminal
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, terminate) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def exit_code(error: KeyboardInterrupt) -> int:
    """Return the exit code of a command that a signal ended."""
    from gridpeers.scenarios.results.run_files import TerminatedError

    return TERMINATED if isinstance(error, TerminatedError) else INTERRUPTED


@contextmanager
def ended_by_signals(left: str) -> Iterator[None]:
    """Do the work of a command; a signal ends it with its exit code, and a line on what is left of the work."""
    try:
        with interruptible():
            yield
    except KeyboardInterrupt as error:
        fail([f"interrupted; {left}"], exit_code(error))
