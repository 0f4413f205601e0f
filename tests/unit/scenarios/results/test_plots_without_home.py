import os
import subprocess
import sys


def test_figures_without_a_home_begin_with_no_warning() -> None:
    """Matplotlib says of a home that cannot be written what its user can do nothing about."""
    environment = {name: value for name, value in os.environ.items() if name not in ("MPLCONFIGDIR", "XDG_CONFIG_HOME")}
    words = [sys.executable, "-c", "import gridpeers.scenarios.sweep.study, gridpeers.scenarios.sweep.sweep_plots"]

    done = subprocess.run(words, env=environment | {"HOME": "/proc/none"}, capture_output=True, text=True, check=True)

    assert (done.stdout, done.stderr) == ("", "")
