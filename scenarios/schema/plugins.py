"""Keys that name something plugged in: a text, or a table with `use` and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import PluginKey
from wire.module_folder import folder_of
from wire.path_text import is_no_path
from wire.plugin import Plugin, plugin_of, plugin_problems, scalar_objection, table_of
from wire.registry import Registry


def placed(key: PluginKey, registry: Registry[Any], folder: Path) -> PluginKey:
    """Return a key as any process can follow it: a decorator's name as `module:Name`, with the folder of the module.

    Examples
    --------
    >>> from agents.graphs import GRAPHS
    >>> placed("ring", GRAPHS, Path("/here")), placed({"use": "mine:Star", "hub": "inv1"}, GRAPHS, Path("/here"))
    ('ring', {'use': 'mine:Star', 'hub': 'inv1', 'folder': '/here'})
    """
    table = table_of(key)
    use = registry.reference(str(table.get("use", "")))
    if ":" not in use or not isinstance(table.get("folder", ""), str) or is_no_path(table.get("folder", "")):
        return key
    return table | {"use": use, "folder": folder_of(use, str((folder / table.get("folder", "")).resolve()))}


def placed_plugin(plugin: Plugin, registry: Registry[Any], folder: Path) -> Plugin:
    """Return a plugin as any process can follow it; see `placed`."""
    use = registry.reference(plugin.use)
    if ":" not in use or is_no_path(plugin.folder):
        return plugin
    return replace(plugin, use=use, folder=folder_of(use, str((folder / plugin.folder).resolve())))


def check_plugin(path: str, key: PluginKey, registry: Registry[Any], problems: Problems) -> Plugin | None:
    """Note what is wrong with a key and with what it names; return the plugin if nothing is."""
    table = table_of(key)
    for name in ("use", "folder"):
        if not isinstance(table.get(name, ""), str):
            problems.add(f"{path}.{name}", "must be a text in quotes")
            return None
        if is_no_path(table.get(name, "")):
            problems.add(f"{path}.{name}" if isinstance(key, Mapping) else path, "can be no name of a module or folder")
            return None
    if not table.get("use"):
        problems.add(path, f'names no {registry.kind}; write e.g. {{ use = "mine:Name" }}')
        return None
    wrong = {name: text for name, value in table.items() if (text := scalar_objection(value))}
    for name, text in wrong.items():
        problems.add(f"{path}.{name}", text)
    if wrong:
        return None
    plugin = plugin_of(table)
    found = plugin_problems(registry, plugin)
    for name, text in found:
        problems.add(f"{path}.{name}" if name and isinstance(key, Mapping) else path, text)
    return None if found else plugin
