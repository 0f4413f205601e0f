"""Texts of users are printed as they are, and one module makes the consoles that print them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gridpeers.cli.progress import progress
from gridpeers.scenarios.console import short, terminal

ROOT = Path(__file__).parents[3]
USERS = "law boom:Boom: [red]of[/red] [bus 7] C:\\feeders\\[a]"


def test_a_text_on_a_terminal_keeps_them_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also the name of a case beside the bar of its progress; colours do not split the words."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "200")
    console = terminal()
    console.print(USERS, soft_wrap=True)
    with progress(console, ("[red]I",)) as tell:
        tell("[red]I", 0.0, 1.0)
        tell("[red]I", 0.5, 1.0)

    printed = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", capsys.readouterr().out)
    assert USERS in printed
    assert "case [red]I" in printed


def test_no_other_module_makes_a_console() -> None:
    """In a notebook's kernel, another console would show what it should return."""
    folders = ("agents", "plant", "netem", "wire", "scenarios", "gridpeers", "papers")
    found = [
        str(file.relative_to(ROOT))
        for folder in folders
        for file in (ROOT / folder).rglob("*.py")
        if re.search(r"\bConsole\(", file.read_text(encoding="utf-8"))
    ]

    assert found == ["scenarios/console.py"]


def test_names_are_short() -> None:
    """Running numbers as ranges."""
    assert short(["inv1", "inv3", "inv4", "inv5", "north"]) == "inv1,3-5 north"
    assert short([]) == "-"
