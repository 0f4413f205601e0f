"""GridLAB-D's process while it reads a .glm file: it ends with the import, however that ends."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

WAITING = """import os, signal
with open(os.environ["TOLD"], "w") as told:
    told.write(f"{os.getpid()} {os.getcwd()}")
signal.pause()
"""
"""A package gridlabd that tells its process and folder, and then loads for ever."""

READ = "import sys; from gridpeers.bridges.gridlabd.read_glm import read_glm; read_glm(sys.argv[1])"


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model; what the package gridlabd is, the test says in `gridlabd.py` beside it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = tmp_path / "x.glm"
    path.write_text("module powerflow;\n")
    return path


def test_a_killed_import_leaves_no_process_and_no_folder(model: Path) -> None:
    """After kill -9 of an import GridLAB-D's process ends, and the temporary folder goes with it."""
    folder = model.parent
    (folder / "gridlabd.py").write_text(WAITING)
    told = folder / "told"
    os.mkfifo(told)
    with subprocess.Popen([sys.executable, "-c", READ, str(model)], env=os.environ | {"TOLD": str(told)}) as reading:
        pid, _, scratch = told.read_text().partition(" ")
        assert Path(scratch).is_dir()
        children = Path(f"/proc/{reading.pid}/task/{reading.pid}/children").read_text().split()
        assert pid in children
        watched = [os.pidfd_open(int(child)) for child in children]  # and the shell that removes the folder
        reading.kill()

    assert reading.returncode == -signal.SIGKILL
    for each in watched:
        assert select.select([each], [], [], 60.0)[0] == [each]
        os.close(each)
    assert not Path(scratch).exists()
