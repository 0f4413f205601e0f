"""A page of the documentation: its blocks, run from its top to its end in a folder of its own."""

from __future__ import annotations

import doctest
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any, NamedTuple

import typer

from gridpeers.cli.root import app
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema.loading import check_tables
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.schema.table_schema import fields_of

_BLOCK = re.compile(r"((?:^ *<!--(?:(?!-->).)*-->\n\s*)*)^( *)```([\w-]*)[^\n]*\n(.*?)^\2```$", re.S | re.M)
_COMMENT = re.compile(r"<!-- *(skip|exit|file): *(.*?) *-->", re.S)
_NEVER_RUN = ("", "bash", "sh", "shell", "shell-session")
"""Languages that a page does not use: what is typed is console, and what is only shown is text."""

_SLOW = re.compile(r"^(?:still |starting \.\.\. |checking the start |case \S+: \S+ s simulated in ).*\n", re.M)
"""Lines that a command prints only where it takes long: the machine decides, and no page shows them."""

_TIME_LIMIT_S = 240.0
_BEFORE_A_COMMAND = re.compile(r"do|then|else|time|exec|nohup|!|\w+=.*", re.S)


class Block(NamedTuple):
    """A block of code."""

    line: int
    language: str
    text: str
    comments: Mapping[str, str]
    """Values of the comments before the block: skip, exit, file."""


def blocks_of(page: str) -> Iterator[Block]:
    for found in _BLOCK.finditer(page):
        comments, indent, language, text = found.groups()
        line = page[: found.start(3)].count("\n") + 1
        yield Block(line, language, dedent(text) if indent else text, dict(_COMMENT.findall(comments)))


def inline_code(page: str) -> list[str]:
    """Return the code within the sentences of a page."""
    return re.findall(r"(?<!`)`([^`]+)`(?!`)", _BLOCK.sub("", page))


def commands_of(block: str) -> Iterator[tuple[str, str]]:
    r"""Yield each command of a console block with the output below it; a line that ends in `\` goes on in the next."""
    for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
        command = re.match(r"(?:[^\n]*\\\n)*[^\n]*", part)
        assert command is not None
        yield re.sub(r"\\\n(?:> )?", "", command[0]), part[command.end() :]


def is_shown(output: str, shown: str) -> bool:
    """Whether an output is as the page shows it: `...` stands for anything, white space is normalised."""
    parts = [re.escape(" ".join(part.split())) for part in shown.split("...")]
    return bool(re.fullmatch(".*".join(parts), " ".join(output.split())))


def calls_of(command: str) -> Iterator[list[str]]:
    """Yield the words behind each `gridpeers` of a command of a shell."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    calls: list[list[str]] = [[]]
    words = iter(lexer)
    for word in words:
        if set(word) <= set(";&|()"):
            calls.append([])
        elif set(word) <= set("<>&"):
            next(words, None)
            if calls[-1] and calls[-1][-1] in "12":
                calls[-1].pop()
        else:
            calls[-1].append(word)
    for call in calls:
        while call and _BEFORE_A_COMMAND.fullmatch(call[0]):
            del call[0]
        if call and Path(call[0]).name == "gridpeers":
            yield call[1:]


def parse(words: list[str], *, whole: bool = True) -> None:
    """Have the command line read the words behind `gridpeers`; it raises where a command or an option does not exist.

    Where a sentence only names a command, which is then not `whole`, arguments may be missing.
    """
    command: Any = typer.main.get_command(app)
    context = command.make_context("gridpeers", [], resilient_parsing=True)
    name, rest = "", list(words)
    while rest and hasattr(command, "get_command") and not rest[0].startswith("-"):
        name = rest.pop(0)
        command = command.get_command(context, name)
        assert command is not None, f"gridpeers {' '.join(words)}: no command {name}"
    try:
        with suppress(typer.Exit):
            command.make_context(name, rest, parent=context)
    except typer.TyperException as error:
        if whole or type(error).__name__ not in ("MissingParameter", "BadOptionUsage", "NoArgsIsHelpError"):
            raise AssertionError(f"gridpeers {' '.join(words)}: {error.format_message()}") from None


class PageRun:
    """The folder, the shell and the namespace in which the blocks of a page run, one after the other."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.module = ModuleType("page")
        self.module.__file__ = str(folder / "page.py")
        sys.modules["page"] = self.module  # classes of the page look for it
        path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
        self.environment = os.environ | {"PATH": path, "PWD": str(folder), "COLUMNS": "80", "MPLBACKEND": "agg"}
        self.environment.pop("PYTHONPATH", None)
        self._groups: list[int] = []

    def run(self, block: Block) -> None:
        """Run a block, or, where the page says why not, have its commands parsed."""
        assert block.language not in _NEVER_RUN, f"line {block.line}: write console, or text, not {block.language!r}"
        if "skip" in block.comments:
            assert block.comments["skip"], f"line {block.line}: a block is skipped without a reason"
            for command, _ in commands_of(block.text) if block.language == "console" else ():
                for words in calls_of(command):
                    parse(words)
            return
        os.chdir(self.environment["PWD"])
        if name := block.comments.get("file"):
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_text(block.text, encoding="utf-8")
        match block.language:
            case "console":
                self._console(block)
            case "pycon":
                self._session(block)
            case "python" if not name:
                code = compile("\n" * block.line + block.text, self.module.__file__ or "", "exec")
                exec(code, vars(self.module))
            case "toml" if not name:
                self._scenario(block)

    def _console(self, block: Block) -> None:
        commands = list(commands_of(block.text))
        assert commands, f"line {block.line}: no line of the block starts with $"
        for command, shown in commands:
            code, output = self._shell(command)
            told = f"line {block.line}: $ {command}\n{output}\nended with {code}"
            assert code == int(block.comments.get("exit", 0)), told
            assert is_shown(output, shown), f"{told}, and the page shows:\n{shown}"

    def _shell(self, command: str) -> tuple[int, str]:
        """Return exit code and output of a command; the next one has its folder and its environment."""
        kept = self.folder.with_suffix(".env")
        with tempfile.TemporaryFile("w+") as output:  # a process in the background would hold a pipe open
            words = ["bash", "-c", f'trap "env -0 > {shlex.quote(str(kept))}" EXIT\n{command}']
            process = subprocess.Popen(
                words,
                cwd=self.environment["PWD"],
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            self._groups.append(process.pid)
            code = process.wait(_TIME_LIMIT_S)
            self.environment = dict(
                entry.split("=", 1) for entry in kept.read_text(encoding="utf-8").split("\0") if "=" in entry
            )
            output.seek(0)
            return code, _SLOW.sub("", output.read())

    def _session(self, block: Block) -> None:
        test = doctest.DocTestParser().get_doctest(block.text, {}, "page", self.module.__file__, block.line)
        test.globs = vars(self.module)
        assert test.examples, f"line {block.line}: no line of the session starts with >>>"
        said: list[str] = []
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
        failed, _ = runner.run(test, out=said.append, clear_globs=False)
        assert failed == 0, "".join(said)

    def _scenario(self, block: Block) -> None:
        """Parse TOML; a part of a scenario is checked on top of the islanding scenario, which nothing judges then."""
        own = tomllib.loads(block.text)
        if not set(own) <= {field.key for table in (ScenarioModel, Netem) for field in fields_of(table)}:
            return
        islanding = tomllib.loads((CATALOGUE / "islanding.toml").read_text(encoding="utf-8"))
        del islanding["paper"]
        problems = Problems("page.toml", block.text)
        check_tables(_merged(islanding, own), Path.cwd() / "page.toml", problems)
        problems.raise_if_any()

    def end(self) -> None:
        for group in self._groups:
            with suppress(ProcessLookupError):
                os.killpg(group, signal.SIGKILL)


def _merged(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    both = {key: _merged(base[key], own[key]) for key in own if isinstance(own[key], dict) and key in base}
    return {**base, **own, **both}
