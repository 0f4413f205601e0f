"""The commands, snippets and sessions of the README work as they stand."""

from __future__ import annotations

import doctest
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer

from gridpeers.cli.root import app
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import load_scenario

README = Path(__file__).parents[3] / "README.md"
TEXT = README.read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", TEXT, re.S | re.M)
SNIPPETS = [block for language, block in BLOCKS if not language and re.search(r"^\[\[?[a-z]", block, re.M)]
ROWS = [line for line in TEXT.splitlines() if line.startswith("| ") and "gridpeers" in line]


def commands(row: str) -> list[list[str]]:
    """Command lines of `gridpeers` in a row of a table."""
    parts = [part for code in re.findall(r"`([^`]+)`", row) for part in code.split("&&")]
    words = [shlex.split(part.strip()) for part in parts]
    return [line[1:] for line in words if line and Path(line[0]).name == "gridpeers"]


COMMANDS = [(row, line) for row in ROWS for line in commands(row)]


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_of_a_scenario_passes_check_below_the_catalogues_own(snippet: str, tmp_path: Path) -> None:
    """Written below a copy of the islanding scenario, with its cases taken out, it is a scenario that can be run."""
    text = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text[: text.index("[case.")] + snippet, encoding="utf-8")

    scenario, _ = load_scenario(tmp_path / "mine.toml")

    assert list(scenario.cases) == list(tomllib.loads(snippet)["case"])


def command_of(line: list[str]) -> Any:
    """The command of a command line, and the context to parse it in."""
    group: Any = typer.main.get_command(app)
    context = group.make_context("gridpeers", list(line), resilient_parsing=True)
    return group.get_command(context, line[0]), context


@pytest.mark.parametrize(("row", "line"), COMMANDS, ids=[" ".join(line) for _, line in COMMANDS])
def test_a_command_of_the_readme_is_one(row: str, line: list[str]) -> None:
    """Its words and options are those of the command line."""
    command, context = command_of(line)

    assert command is not None, line[0]
    command.make_context(line[0], line[1:], parent=context)


ROOT = Path(__file__).parents[3]
PAGES = ("README.md",)


@pytest.mark.parametrize("page", PAGES)
def test_a_session_is_shown_as_it_goes(page: str) -> None:
    """Every line that is typed gives what stands below it."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"```pycon\n(.*?)```", text, re.S))
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    test = doctest.DocTestParser().get_doctest(blocks, {}, page, page, 0)
    said: list[str] = []

    failed, tried = doctest.DocTestRunner(optionflags=flags).run(test, out=said.append)

    assert tried >= 7
    assert failed == 0, "".join(said)
