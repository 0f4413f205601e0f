"""The commands that read a record, on one that a killed process, or a full disk, has left behind."""

from __future__ import annotations

from pathlib import Path

from gridpeers.cli.root import COMMANDS
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke


def assert_commands_read(record: RunRecord, agent: str = "inv4") -> None:
    """`export`, `why`, `trace`, and `replay` where there is one, do their work, and tell the cut.

    Of a run that was killed in its first moments there may be no decision yet: then `why`, and `replay`, say so. There
    may not even be a row: then they say so too, or have nothing to show.
    """
    begun = record.t_end > 0.0
    decided = next(record.decisions(agent), None) is not None
    file, folder, t = str(record.path), record.path.parent, f"{record.t_end:.3f}"
    commands = {
        "export": (file, "--to", "csv", "--out", str(folder / "tables")),
        "why": (file, agent, t),
        "trace": (file, "--out", str(folder / "trace.pftrace")),
        "replay": (file,),
    }
    for command, arguments in commands.items():
        if command not in COMMANDS.names:
            continue
        code, printed = invoke(command, *arguments)
        if not begun:
            assert code in (0, 2)
            assert "Traceback" not in printed
            continue
        if not decided and command == "why":
            assert code == 2
            assert "had not decided anything" in printed
            continue
        if not decided and command == "replay" and code:
            assert code == 2
            assert "it ends before" in printed or "ends before anything" in printed
            continue
        assert code == 0, f"gridpeers {command} {' '.join(arguments)}: {code}: {printed}"
        assert "Traceback" not in printed
        assert record.complete or command == "replay" or "cut off" in printed, f"{command}: {printed}"
    assert not begun or _size(folder / "trace.pftrace") > 500


def _size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0
