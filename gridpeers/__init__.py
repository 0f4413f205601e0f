"""gridpeers as a library: scenarios, runs, results, sweeps and predictions in Python.

>>> import gridpeers as gp
>>> scenario = gp.load("islanding").replace({"gains.k_p": 0.001})
>>> list(scenario.cases)
['I', 'II', 'III', 'IV']

`scenario.run("IV")` gives a `Result`: its `history`, `metrics`, `events` and `links` are pandas tables, `plot()` draws
it, and `save(folder)` writes the folder that the command `gridpeers run` writes. docs/python.md has the whole face.

Nothing heavy is imported before it is used: the command line and every agent's process start through this package.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from operator import attrgetter
from typing import Any


@cache
def _homes() -> dict[str, str]:
    """Return `module:attributes` of each public name, from the stub `__init__.pyi`: the names are written once."""
    import ast
    from pathlib import Path

    found: dict[str, str] = {}
    for line in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
        if isinstance(line, ast.ImportFrom):
            found |= {one.asname or one.name: f"{line.module}:{one.name}" for one in line.names}
        elif isinstance(line, ast.Assign):
            imported, _, method = ast.unparse(line.value).partition(".")
            home = found[imported]
            found[ast.unparse(line.targets[0])] = f"{home}.{method}" if method else f"{home.replace(':', '.')}:"
    return {name: home for name, home in found.items() if not name.startswith("_")}


def __getattr__(name: str) -> Any:
    """Import a public name on its first use (PEP 562)."""
    if name == "__all__":
        return list(_homes())
    if name == "__version__":
        from importlib.metadata import version

        return version("gridpeers")
    if name not in _homes():
        from gridpeers.wire.wording import suggestion

        raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, __dir__(), "names")}')
    module, _, attributes = _homes()[name].partition(":")
    if module.startswith("gridpeers.lab."):  # a room above the face, which may be missing
        from gridpeers.rooms import ROOMS

        found = ROOMS.resolve(name)
    else:
        found = import_module(module)
        found = attrgetter(attributes)(found) if attributes else found
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """Return the public names, for completion in a notebook."""
    return sorted([*_homes(), "__version__"])
