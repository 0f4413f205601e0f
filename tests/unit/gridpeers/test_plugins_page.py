"""The distribution of docs/how-to/plug-ins.md brings a command, a reader of feeders and a simulator."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

from tests.pages.page import blocks_of

PAGE = (Path(__file__).parents[3] / "docs" / "how-to" / "plug-ins.md").read_text(encoding="utf-8")


def test_a_distribution_brings_a_command_a_reader_of_feeders_and_a_simulator(tmp_path: Path) -> None:
    """The page's modules and entry points, as pip installs them."""
    for block in blocks_of(PAGE):
        if name := block.comments.get("file"):
            (tmp_path / name).write_text(block.text, encoding="utf-8")
    (tmp_path / "x.copy").write_text("ieee34\n", encoding="ascii")
    about = tmp_path / "mine-1.0.dist-info"
    about.mkdir()
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    points = [
        line for group, of in project["entry-points"].items() for line in (f"[{group}]", *map(" = ".join, of.items()))
    ]
    (about / "entry_points.txt").write_text("\n".join(points))

    def gridpeers(*words: str) -> str:
        command = [sys.executable, "-m", "gridpeers", *words]
        env = os.environ | {"PYTHONPATH": str(tmp_path)}
        done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr  # 1: a claim fails with these sensors
        return done.stdout

    assert gridpeers("feeder", "import", "x.copy", "--out", "y").startswith("ieee34: ")
    gridpeers("run", "islanding", "--case", "IV", "--plant", "biased", "--driver", "inprocess", "--out", "here")
    frequencies = [float(line.split()[1]) for line in gridpeers("nadir", "here").splitlines()[1:]]
    assert len(frequencies) == 9
    assert all(59.0 < f < 60.0 for f in frequencies)
