"""scipy.sparse as the process imports it from which plants are forked."""

from __future__ import annotations

import json
import subprocess
import sys

PROGRAM = """
import json, sys
import numpy
before = dir(numpy), list(numpy.__all__)
from plant.lean_scipy import COPY, import_scipy_sparse
import_scipy_sparse()
lazy = [name for name in before[1] if f"numpy.{name}" not in sys.modules and name not in vars(numpy)]
copy = sys.modules[COPY]
print(json.dumps({
    "restored": (dir(numpy), list(numpy.__all__)) == before,
    "lazy": lazy,
    "same": [getattr(copy, name) is getattr(numpy, name) for name in lazy],
    "unknown": hasattr(copy, "no_such_name"),
}))
"""


def test_numpys_lazy_parts_come_when_they_are_used() -> None:
    """Neither its tests nor its Fortran compiler are imported; scipy's copy and numpy have them as ever."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)

    assert {"testing", "f2py"} <= set(told["lazy"])
    assert all(told["same"])
    assert told["restored"]
    assert not told["unknown"]
