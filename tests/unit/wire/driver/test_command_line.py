"""Commands that are printed for people to type next."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gridpeers.wire.driver.command_line import command_line


def test_a_program_that_is_not_found_by_its_name_has_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an active environment; with one nobody types a path, and from Python a command has its name."""
    for name in ("gridpeers", "pytest"):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.chdir(tmp_path)
    for called in ("./gridpeers", str(tmp_path / "gridpeers")):
        monkeypatch.setattr(sys, "argv", [called])
        assert command_line("run", "a b") == f"{tmp_path}/gridpeers run 'a b'"
        assert command_line(program="pytest") == f"{tmp_path}/pytest"
    monkeypatch.setenv("PATH", str(tmp_path))
    assert command_line("run", "a b") == "gridpeers run 'a b'"
    monkeypatch.setattr(sys, "argv", ["/somewhere/notebook.py"])
    assert command_line("down") == "gridpeers down"
