"""The command `gridpeers` in this process."""

from __future__ import annotations

from contextlib import nullcontext
from unittest.mock import patch

from typer.testing import CliRunner

from gridpeers.cli import root as cli


def invoke(*words: str, figures: bool = False) -> tuple[int, str]:
    """Return the exit code of a command, and all that it printed; the figures of a run, which take 2 s, are left out.

    Parameters
    ----------
    words : str
        The command line, without `gridpeers`.
    figures : bool, optional
        Whether a run draws its figures too.
    """
    drawn = nullcontext() if figures else patch("gridpeers.scenarios.results.plots.run_figures.draw_all", lambda *_: ())
    with drawn if words[:1] == ("run",) else nullcontext():
        result = CliRunner().invoke(cli.app, list(words), catch_exceptions=False, env={"COLUMNS": "160"})
    return result.exit_code, result.output
