"""Shared parts of all commands: exit codes, a scenario by its name, and how a command ends by an error or a signal."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from importlib import util
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn

import typer
from typer import BadParameter
from typer.core import TyperGroup

from gridpeers.scenarios.console import terminal as terminal
from gridpeers.wire.driver.command_line import command_line, pip_install
from gridpeers.wire.driver.ending import stop_handler
from gridpeers.wire.driver.machine import POSIX, too_few_files
from gridpeers.wire.wording import DISTRIBUTIONS, InputError, damaged, printable, suggestion

if TYPE_CHECKING:
    from gridpeers.plant.equipment import Tables
    from gridpeers.scenarios.schema import ScenarioModel


def option(metavar: str, help: str, *names: str, **more: Any) -> Any:
    """Return an option with a value: its word in the help, what it is, and its names if not those of the parameter."""
    return typer.Option(*names, metavar=metavar, help=help, **more)


def flag(help: str, *names: str) -> Any:
    """Return an option without a value: what it does, and its names."""
    return typer.Option(*names, help=help)


def argument(metavar: str, help: str) -> Any:
    """Return an argument: its word in the help, and what it is."""
    return typer.Argument(metavar=metavar, help=help)


ScenarioName = Annotated[str, argument("SCENARIO", "A name that `gridpeers list` shows, or the path of a file.")]
FigureFormat = Annotated[Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the figures.")]
Switches = Annotated[
    list[str] | None, option("LINE", "Line of the .dss or .glm file to turn into a switch; repeatable.", "--switch")
]
LeaveOut = Annotated[
    list[str] | None,
    option("ELEMENT", 'Element to leave out, Class.name; * is any name: "PVSystem.*"; repeatable.', "--leave-out"),
]

PASSED, CLAIM_FAILED, BAD_INPUT, BROKEN, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 130, 143


def load(name: str, changes: Mapping[str, Any] | None = None) -> tuple[ScenarioModel, Tables]:
    """Return a checked scenario, with keys changed by the command line, and its feeder."""
    from gridpeers.scenario import load as load_face

    scenario = load_face(name).replace(changes) if changes else load_face(name)
    return scenario.spec, scenario.feeder


def refuse(error: InputError) -> NoReturn:
    """End with every problem of a file, or of an option that changes a key of it."""
    problems = list(getattr(error, "problems", ())) or str(error).splitlines()
    problems = [re.sub(r"^replace: plant\.simulator:", "--plant:", problem) for problem in problems]
    head = [] if len(problems) == 1 else [f"{len(problems)} problems:"]
    fail(*head, *problems)


def check_choice(option: str, kind: str, value: str, known: Collection[str]) -> None:
    """End with the nearest word if a value is none of those that an option takes."""
    if value not in known:
        fail(f'{option}no {kind} "{value}"; {suggestion(value, tuple(known), f"{kind}s")}')


def chosen(spec: ScenarioModel, case: str | None, seed: int | None) -> ScenarioModel:
    """Return the scenario with the cases and the seed of the command line."""
    from msgspec.structs import replace

    from gridpeers.runs.choices import with_cases

    names = None if case is None else [name.strip() for name in case.split(",") if name.strip()] or [case]
    spec = with_cases(spec, names, option="--case: ")
    return spec if seed is None else replace(spec, seed=seed)


def require(modules: Mapping[str, str], extra: str = "") -> None:
    """End with one line if packages of an extra are missing; `modules` says what each package is needed for.

    Packages of the core need no such check: `gridpeers.cli.app` ends any command with the name of a missing one.
    """
    if lacking := {DISTRIBUTIONS.get(name, name): use for name, use in modules.items() if util.find_spec(name) is None}:
        are, them = ("is", "it") if len(lacking) == 1 else ("are", "them")
        uses = " and ".join(dict.fromkeys(lacking.values()))
        install = pip_install(extra) if extra else f"pip install {' '.join(lacking)}"
        fail(f"{', '.join(lacking)} {are} not installed, and needed for {uses}; install {them}: {install}")


def require_loadable(module: str, user: str) -> None:
    """End with a clear line if a package with a library of its own is missing or damaged; its extra has its name."""
    require({module: user}, module)
    done = subprocess.run([sys.executable, "-P", "-c", f"import {module}"], capture_output=True, text=True, check=False)
    if done.returncode:
        reason = done.stderr.strip().rpartition("\n")[2] or f"exit status {done.returncode}"
        fail(damaged(module, reason, user))


def require_posix(what: str) -> None:
    """End with a clear line on a system where gridpeers runs in one process alone."""
    if not POSIX:
        run = command_line("run", "SCENARIO", "--driver", "inprocess")
        fail(f"{what} needs Linux or macOS; this system runs a scenario in one process: {run}")


def fail(*lines: str, code: int = BAD_INPUT) -> NoReturn:
    """End the command with lines on standard error; characters that cannot be printed are escaped."""
    for line in lines:
        print("gridpeers: " + "\n".join(map(printable, line.split("\n"))), file=sys.stderr)
    raise SystemExit(code)


@contextmanager
def interruptible() -> Iterator[None]:
    """Have SIGTERM, and a terminal that goes away, end what is inside as Ctrl-C does: by `KeyboardInterrupt`.

    Signals within a second are one request, those of Ctrl-C too, which `timeout` passes on twice.
    """
    from gridpeers.scenarios.results.run_files import TerminatedError  # imports msgspec, which the help does without

    terminate, numbers = stop_handler(TerminatedError), [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else a shell has it ignored, or another has it
        numbers.append(signal.SIGINT)
    if POSIX and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # else nohup: the run outlives its terminal
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
        fail(f"interrupted; {left}", code=exit_code(error))


_UsageError: type[BaseException] = BadParameter.__mro__[1]
"""Base of all problems on a command line; releases of typer keep it in different modules."""


class Commands(TyperGroup):
    """Commands that report mistyped words in one line, where typer prints three."""

    def make_context(self, *words: Any, **extra: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().make_context(*words, **extra)

    def invoke(self, ctx: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: D102
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            fail(f'no command "{args[0]}"; {suggestion(args[0], self.list_commands(ctx), "commands", brief=True)}')
        return super().resolve_command(ctx, args)


@contextmanager
def _in_one_line() -> Iterator[None]:
    try:
        yield
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # the help is all that it says
            raise
        fail(_line(error))
    except InputError as error:
        refuse(error)
    except OSError as error:  # the machine refuses something: no memory for a process, no room on a disk
        fail(too_few_files(error) or str(error), code=BROKEN)


def _line(error: Any) -> str:
    """Return a problem in one line, in typer's words, with the command that shows the help."""
    param: Any = getattr(error, "param", None)
    if type(error).__name__ == "MissingParameter" and param is not None and param.metavar == "SCENARIO":
        return f"SCENARIO is missing: e.g. islanding, plug-n-play or partition; {command_line('list')} shows all"
    if type(error).__name__ == "MissingParameter" and error.ctx.command.params[0].metavar == "RUN":
        return f"{param.metavar} is missing; RUN comes first: {error.ctx.command.help.partition('Example:')[2].strip()}"
    message = " ".join(error.format_message().split()).rstrip(".").replace("Value error, ", "")
    words: list[str] = []
    ctx = error.ctx
    while ctx is not None and ctx.parent is not None:
        words, ctx = [ctx.info_name, *words], ctx.parent
    return f"{message[:1].lower()}{message[1:]}; see {command_line(*words, '-h')}"
