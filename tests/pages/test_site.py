"""The site: its generated parts are whole, and its pages stay few and short."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
import typer

import gridpeers as gp
from gridpeers.cli.root import COMMANDS, app
from gridpeers.scenarios.reference import TOPICS, page

DOCS = Path(__file__).parents[2] / "docs"
MOST_PAGES, MOST_WORDS, MOST_GENERATED = 30, 43_000, 16_000
SPEC = spec_from_file_location("site_hooks", DOCS / "hooks.py")
assert SPEC is not None
assert SPEC.loader is not None
HOOKS = module_from_spec(SPEC)
SPEC.loader.exec_module(HOOKS)


def commands(command: Any, name: str, parent: Any = None) -> Iterator[tuple[str, list[str]]]:
    """Yield each command and its options, by the long name."""
    context = command.make_context(name, [], parent=parent, resilient_parsing=True)
    yield context.command_path, [param.opts[-1] for param in command.get_params(context) if param.opts[-1][:2] == "--"]
    for below in command.list_commands(context) if hasattr(command, "list_commands") else ():
        yield from commands(command.get_command(context, below), below, context)


def test_the_reference_of_the_command_line_has_every_command_and_option(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each has its heading, a plug-in with a long name too; an option that several commands have stands at its end."""
    monkeypatch.setitem(COMMANDS.own, "a-name-that-the-help-writes-on-its-own-line", "platform:python_version")
    _, *each = commands(typer.main.get_command(app), "gridpeers")
    sections = re.split(r"^####? ", HOOKS.part("command line"), flags=re.M)
    of_command = {section.partition("\n")[0]: section for section in sections}

    assert {path for path, _ in each} <= of_command.keys()
    for path, names in each:
        assert [name for name in names if f"`{name}" not in of_command[path] and name != "--help"] == []


def test_the_reference_of_python_has_every_public_name() -> None:
    """Those of a class too: its fields, properties and methods."""
    sections = dict(section.split("\n", 1) for section in HOOKS.part("python").split("\n#### ")[1:])

    assert sections.keys() == {f"gp.{name}" for name in gp.__all__}
    for name in ("Scenario", "Result", "Results", "Feeder"):
        of_class = {it for it in vars(getattr(gp, name)) if not it.startswith("_")}
        assert [it for it in of_class if f"`{it}" not in sections[f"gp.{name}"]] == []


@pytest.mark.parametrize("topic", TOPICS)
def test_a_reference_has_every_row_that_the_command_prints(topic: str) -> None:
    """Every code of `gridpeers doc` stands in the part."""
    part = HOOKS.part(f"doc {topic}")

    assert [code for code in re.findall(r"`[^`]+`", page(topic).partition("\n")[2]) if code not in part] == []


def test_the_pages_stay_few_and_short() -> None:
    """Hand-written words and pages; and words of the parts that pages ask for."""
    pages = {file: file.read_text(encoding="utf-8") for file in DOCS.rglob("*.md")}
    markers = re.findall(r"^<!-- *generated: *(.*?) *-->$", "\n".join(pages.values()), flags=re.M)

    assert len(pages) + 1 <= MOST_PAGES, "with contributing.md: join the new page with another"
    assert sum(len(text.split()) for text in pages.values()) <= MOST_WORDS
    assert sum(len(re.findall(r"\w\S*", HOOKS.part(name))) for name in markers) <= MOST_GENERATED
