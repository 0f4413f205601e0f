"""A scenario for a file that others get: folders of its laws, checks and feeder are named from the file on."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from gridpeers.scenarios.schema.plugin_keys import with_keys
from gridpeers.scenarios.schema.scenario_model import PluginKey, ScenarioModel
from gridpeers.wire.plugins.plugin import table_of
from gridpeers.wire.plugins.registry import Registry


def with_relative_folders(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return a checked scenario as it is written into a file that can be moved together with what stands beside it.

    Parameters
    ----------
    scenario : ScenarioModel
        Checked, so with absolute folders of what is its own: laws, graphs, metrics, claims, checks, faults, feeder.
    folder : Path
        Folder of the file to be written.
    """
    here = folder.resolve()

    def change(key: PluginKey, registry: Registry[Any]) -> PluginKey:
        table = table_of(key)
        return table | {"folder": relative(str(table["folder"]), here)} if table.get("folder") else key

    plant = replace(scenario.plant, feeder=relative(scenario.plant.feeder, here))
    return with_keys(replace(scenario, plant=plant), change)


def relative(place: str, here: Path) -> str:
    """Return a folder as it is named from another one; the same where they have nothing but the root in common.

    Examples
    --------
    >>> relative("/home/eva/study", Path("/home/eva/found/failures")), relative("/opt/laws", Path("/home/eva/found"))
    ('../../study', '/opt/laws')
    >>> relative("microgrid123", Path("/home/eva"))
    'microgrid123'
    """
    if not Path(place).is_absolute() or os.path.commonpath([place, here]) == os.sep:
        return place
    return os.path.relpath(place, here)
