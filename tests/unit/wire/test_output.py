"""Standard output of a command stays open and is written to its end, whatever code of a user does to it."""

import subprocess
import sys

import pytest

SCRIPT = """
import sys
from gridpeers.wire.driver.output import speaking
with speaking("gridpeers"):
    print("before")
    try:
        {foreign}
    except OSError as error:
        print(error)
    print("after")
"""


@pytest.mark.parametrize("unbuffered", [[], ["-u"]], ids=["buffered", "unbuffered"])
@pytest.mark.parametrize("foreign", [
    "sys.stdout.close(); sys.stderr.close()",
    "sys.stdout.buffer.close()",
    "getattr(sys.stdout.buffer, 'raw', sys.stdout.buffer).close()",
])  # fmt: skip
def test_code_of_a_user_cannot_close_the_output(foreign: str, unbuffered: list[str]) -> None:
    """What is printed afterwards is there, and the command ends as it would have."""
    script = SCRIPT.format(foreign=foreign)
    done = subprocess.run([sys.executable, *unbuffered, "-c", script], capture_output=True, text=True, timeout=30.0)

    assert (done.returncode, done.stdout, done.stderr) == (0, "before\nafter\n", "")


def test_output_cannot_be_taken_apart() -> None:
    """It raises an error that says what to use, and the output goes on."""
    script = SCRIPT.format(foreign="sys.stdout.detach()")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30.0)

    said = "standard output and error stay as they are; write to their .buffer"
    assert (done.returncode, done.stdout, done.stderr) == (0, f"before\n{said}\nafter\n", "")


def test_output_that_somebody_has_replaced_ends_without_a_traceback() -> None:
    """A stream of their own that is closed, or none, has nothing to be written at the end."""
    foreign = "import io; sys.stdout.flush(); sys.stdout = io.TextIOWrapper(io.BytesIO())"
    script = SCRIPT.format(foreign=foreign).replace('print("after")', "sys.stdout.close(); sys.stderr = None")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=30.0)

    assert (done.returncode, done.stdout, done.stderr) == (0, "before\n", "")
