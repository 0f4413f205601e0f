"""What a run with emulated links does not import."""

import subprocess
import sys
from pathlib import Path

LOSSY = """
[time]
end_s = 1.5
[case.lossy]
secondary = "all"
graph = "ring"
[[link]]
on = "inv1 <-> inv2"
loss = 0.2
delay = 0.02
"""


def test_a_run_does_not_import_what_only_a_check_on_request_needs(tmp_path: Path) -> None:
    """scipy.stats takes half a second."""
    (tmp_path / "lossy.toml").write_text(LOSSY)
    code = (
        "import sys, gridpeers as gp; gp.load('lossy.toml').run('lossy', folder='here');"
        "print('scipy.stats' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=100)

    assert done.stdout == "False\n", done.stderr
