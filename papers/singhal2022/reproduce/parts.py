"""The parts of the report, as parts.toml has them: experiments with their figures, and the settings that are ours."""

from __future__ import annotations

from pathlib import Path

import msgspec


class Picture(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    key: str
    """Its name in claims, and its file's name."""
    file: str
    """File in the run's folder of plots."""
    title: str
    """Its contents, and the figure of the paper that it stands for."""
    note: str = ""
    """A hint for the reader, besides the claims."""

    @property
    def stem(self) -> str:
        return self.file.partition(".")[0]


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of the reproduction: one experiment, the paper's or ours."""

    name: str
    """Name for `--only`: that of the scenario, or "topology"."""
    title: str
    what: str
    """The course of events, in a sentence or two."""
    picture: tuple[Picture, ...]
    experiment: str = ""
    """Whose tables and claims; "" for one that is ours."""
    tables: bool = False
    """Whether the paper has a table of it."""


class Setting(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A setting of ours that the paper does not print."""

    name: str
    value: str
    """Its value with the unit: a format of the tables of the first scenario."""
    why: str
    case: str = ""
    """Case whose gains are meant, of the part reduced-communication; without that part it is not shown."""


class _Parts(msgspec.Struct, forbid_unknown_fields=True):
    part: tuple[Part, ...]
    setting: tuple[Setting, ...]


_READ = msgspec.toml.decode(Path(__file__).with_name("parts.toml").read_bytes(), type=_Parts)
PARTS, SETTINGS = _READ.part, _READ.setting

CHOICES = ("tables", "figures", *(part.name for part in PARTS))
"""Values of `--only`."""


def chosen(only: str | None) -> tuple[Part, ...]:
    """Return the parts that are to be run."""
    if only in (None, "figures"):
        return PARTS
    return tuple(part for part in PARTS if (part.tables if only == "tables" else part.name == only))
