"""gridpeers as a library: scenarios, runs, results, sweeps and predictions in Python.

>>> import gridpeers as gp
>>> scenario = gp.load("islanding").replace({"gains.k_p": 0.001})
>>> list(scenario.cases)
['I', 'II', 'III', 'IV']

`scenario.run("IV")` returns a `Result`: its `history`, `metrics`, `events` and `links` are pandas tables, `plot()`
draws it, and `save(folder)` writes a run folder. docs/reference/python.md has all public names.

Nothing heavy is imported before it is used: the command line and every agent's process start through this package.
"""

from __future__ import annotations

import re
from importlib import import_module
from operator import attrgetter
from typing import Any


def _homes() -> dict[str, str]:
    """Return `module:attributes` of each public name, or a module, as `__init__.pyi` has them."""
    with open(f"{__file__}i", encoding="utf-8") as stub:  # noqa: PTH123  # pathlib would be the slower half of this
        text = stub.read()
    lines = re.findall(r"^from (\S+) import (.+)$", text, re.M)
    imported = {name: f"{module}:{name}" for module, names in lines for name in re.findall(r"\w+", names)}
    homes = {name: imported[name] for name in re.findall(r"(\w+) as \1$", text, re.M)}
    for name, source, method in re.findall(r"^(\w+) = (\w+)(\.\w+)?$", text, re.M):
        homes[name] = imported[source] + method if method else imported[source].replace(":", ".")
    return homes


def __getattr__(name: str) -> Any:
    """Import a public name on its first use (PEP 562); rooms above the face bring some of them."""
    if name == "__version__":
        from importlib.metadata import version

        return version("gridpeers")
    homes = _homes()
    if name == "__all__":
        return list(homes)
    if name not in homes:
        from gridpeers.wire.wording import suggestion

        raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, __dir__(), "names")}')
    module, _, attributes = homes[name].partition(":")
    if module.startswith("gridpeers.lab."):
        from gridpeers.rooms import ROOMS

        found = ROOMS.resolve(name)
    else:
        found = import_module(module)
        found = attrgetter(attributes)(found) if attributes else found
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*_homes(), "__version__"])
