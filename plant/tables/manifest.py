"""feeder.toml: what holds for a feeder as a whole. The file may be missing."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from plant.equipment import F_NOM
from plant.tables.plausible_feeder import NOMINAL_FREQUENCY
from wire.suggestion import suggestion

MANIFEST = "feeder.toml"
"""Name of the file."""

KEYS = ("f_nom_Hz",)
"""Its keys: nominal frequency (Hz)."""


def read_f_nom(folder: Path, problems: list[str]) -> float:
    """Nominal frequency (Hz) of a feeder; 60 Hz where nothing is said."""
    data = _tables(folder / MANIFEST, problems)
    for key in data:
        if key not in KEYS:
            problems.append(f"{MANIFEST}: {key}: unknown key; {suggestion(key, KEYS, 'keys')}")
    f_nom = data.get("f_nom_Hz", F_NOM)
    if not isinstance(f_nom, (int, float)) or isinstance(f_nom, bool):
        problems.append(f"{MANIFEST}: f_nom_Hz: must be a number, got {f_nom!r}; write f_nom_Hz = 50.0")
        return F_NOM
    if wrong := NOMINAL_FREQUENCY.objection(float(f_nom), "Hz"):
        problems.append(f"{MANIFEST}: f_nom_Hz: {wrong}")
        return F_NOM
    return float(f_nom)


def _tables(path: Path, problems: list[str]) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        return {}
    except OSError as error:
        problems.append(f"{path.name}: cannot be read: {error.strerror}")
    except (ValueError, RecursionError) as error:  # no TOML, or no UTF-8
        problems.append(f"{path.name}: not valid TOML: {error}")
    return {}
