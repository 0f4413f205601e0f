"""The command `gridpeers` in this process."""

from __future__ import annotations

from typer.testing import CliRunner

from gridpeers.cli import root as cli


def invoke(*words: str) -> tuple[int, str]:
    """Exit code of a command, and all that it printed."""
    result = CliRunner().invoke(cli.app, list(words), catch_exceptions=False, env={"COLUMNS": "160"})
    return result.exit_code, result.output
