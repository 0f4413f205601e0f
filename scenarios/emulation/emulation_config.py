"""What every process of a run with faults is told, as one text in its configuration."""

from __future__ import annotations

import msgspec

from netem.spec.netem import Netem


class Setup(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The run's faults, and who stands where."""

    netem: Netem
    """All entries; a partition by island is resolved already."""
    microgrids: dict[str, str]
    """Microgrid of every inverter, spare ones too, in the order of their table."""
    real_nodes: bool = False
    """Whether what befalls processes really does, as in wall-clock time; else it is emulated."""
    keep_trace: bool = True
    """Whether every verdict is reported, not only their counts and their hash."""

    def to_text(self) -> str:
        """As it stands in a configuration."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def of_text(cls, text: str) -> Setup:
        """From a configuration."""
        return msgspec.json.decode(text, type=cls)
