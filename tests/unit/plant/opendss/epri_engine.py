"""Solves scripts with EPRI's own OpenDSS engine (py-dss-interface), in a process of its own: it prints, and holds one.

Usage: python epri_engine.py OUT.json Master.dss [Master.dss ...]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def main(out: Path, paths: list[str]) -> None:
    """Write the voltage [real, imaginary] (V) of every node of each circuit."""
    import py_dss_interface  # a part of the extra validation alone

    engine = py_dss_interface.DSS()
    solved = {}
    settle = "set maxcontroliter=1000", "set maxiterations=1000", "solve"
    for path in paths:
        for command in (f'compile "{path}"', *settle, "set controlmode=off", "set tolerance=1e-10", "solve"):
            engine.text(command)
        names, flat = engine.circuit.y_node_order, engine.circuit.y_node_varray
        pairs = zip(flat[0::2], flat[1::2], strict=True)
        solved[path] = {name.lower(): list(pair) for name, pair in zip(names, pairs, strict=True)}
    out.write_text(json.dumps(solved))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
