"""Record the saved run in real time anew: `python -m tests.golden.records.pin`; see README.md beside it."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import gridpeers as gp

HERE = Path(__file__).parent
RECORD = HERE / "realtime.mcap"
REPLAY = ("replay",)
WHY = ("why", "inv4", "1.4")
SAID = {REPLAY: HERE / "replay.txt", WHY: HERE / "why.txt"}
"""What commands say of the record: command and the words after the record's path, and the file."""


def main() -> None:
    """Run it, and save the record and what commands say of it."""
    from tests.command_line import invoke

    scenario = gp.Scenario(
        name="saved",
        seed=7,
        time={"end_s": 1.5, "T_c_s": 0.1, "record_s": 0.1},
        plant={"load_set": "main"},
        event=[
            {"label": "islanding", "t_s": 0.2, "open": ["13-152"]},
            {"label": "leave", "t_s": 0.4, "leave": ["inv2"]},
            {"label": "return", "t_s": 0.8, "join": ["inv2"]},
        ],
        case={"ring": {"secondary": "all", "graph": "ring", "link": [{"on": "* -> inv4", "loss": 0.3, "delay": 0.03}]}},
    )
    with tempfile.TemporaryDirectory() as folder:
        scenario.run("ring", driver="processes", clock="realtime", folder=Path(folder) / "run")
        shutil.copy(Path(folder) / "run" / "ring" / "run.mcap", RECORD)
    for (command, *words), file in SAID.items():
        file.write_text(invoke(command, str(RECORD), *words)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
