"""What others know of the plant without importing it: words of its start, names and settings of trips."""

from __future__ import annotations

LISTENING = "listening"  # its session is open
COMPILING = "compiling"  # it is being built; its step may be compiled first, which takes up to a minute
READY = "ready"  # it waits for agents
SUBSTATION = "substation"  # name of a substation that trips, in the text of the event, beside those of inverters
F_BASE = 60.0  # nominal frequency (Hz) of the standard's settings; at another one the defaults are in proportion

_FREQUENCY = {"OF2": (62.0, 0.16), "OF1": (61.2, 300.0), "UF1": (58.5, 300.0), "UF2": (56.5, 0.16)}

DEFAULTS: dict[str, dict[str, tuple[float, float]]] = {
    "II": {"OV2": (1.20, 0.16), "OV1": (1.10, 2.0), "UV1": (0.70, 10.0), "UV2": (0.45, 0.16)} | _FREQUENCY,
    "III": {"OV2": (1.20, 0.16), "OV1": (1.10, 13.0), "UV1": (0.88, 21.0), "UV2": (0.50, 2.0)} | _FREQUENCY,
}
"""Default trip settings, threshold (pu, or Hz at 60 Hz) and clearing time (s): IEEE 1547-2018, Tables 12, 13 and 18."""


def defaults(category: str, f_nom: float) -> dict[str, tuple[float, float]]:
    """Return the default trip settings at a nominal frequency (Hz): threshold (pu or Hz) and clearing time (s)."""
    scale = f_nom / F_BASE
    return {
        name: (value * scale if name[1] == "F" else value, time) for name, (value, time) in DEFAULTS[category].items()
    }
