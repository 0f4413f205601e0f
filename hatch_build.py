"""Have a distribution carry the commit that it was built from, for `gridpeers --version`."""

from __future__ import annotations

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CommitHook(BuildHookInterface):  # type: ignore[type-arg]
    """Add `gridpeers/commit.txt` where the source is a clone; a source distribution already has it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the file outside the clone, and name it to the builder."""
        if version == "editable" or not (Path(self.root) / ".git").exists():
            return
        words = ["git", "describe", "--always", "--exclude=*", "--dirty=+"]
        done = subprocess.run(words, cwd=self.root, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            self._kept = TemporaryDirectory()  # until the file is built in
            file = Path(self._kept.name) / "commit.txt"
            file.write_text(done.stdout)
            build_data["force_include"][str(file)] = "gridpeers/commit.txt"
