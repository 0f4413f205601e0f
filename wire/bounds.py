"""Types of the fields of messages, each with its bounds. Pure.

Bounds are physical: as wide as a plant, an inverter or a run can be, and no wider. This module alone defines them;
the codec checks them while it decodes.
"""

from __future__ import annotations

import re
from functools import lru_cache
from math import isfinite
from typing import Annotated, Any

import msgspec

from gridpeers.wire.wording import UNPRINTABLE

LONGEST_MESSAGE = 256_000
"""Longest message in bytes: room for a row of telemetry on `MOST_INVERTERS` inverters with long names. All other
messages are a hundredth of it."""

NAME = r"[A-Za-z0-9_.-]{1,64}"
"""Allowed form of a name. Zenoh forbids / * $ ? # in a chunk of a key; a leading @ would hide it from wildcards."""

_PRINTABLE = rf"^[^{UNPRINTABLE}]*\Z"

Name = Annotated[str, msgspec.Meta(pattern=rf"^{NAME}\Z")]
"""Name of an inverter, process or run: 1 to 64 letters, digits, "_", "-" or "."; safe in keys, files and logs."""

NameOrNone = Annotated[str, msgspec.Meta(pattern=rf"^({NAME})?\Z")]
"""The same, or empty if there is none or it is not known."""

QuickName = Annotated[str, msgspec.Meta(max_length=64, extra={"pattern": rf"^{NAME}\Z"})]
"""A name that `__post_init__` checks together with all others of its message: a pattern for each would cost
several times the rest of decoding, and states and measurements are decoded at every tick."""

QuickNameOrNone = Annotated[str, msgspec.Meta(max_length=64, extra={"pattern": rf"^({NAME})?\Z"})]
"""The same, or empty."""

Label = Annotated[str, msgspec.Meta(max_length=200, pattern=_PRINTABLE)]
"""A label from a user's table: up to 200 printable characters."""

Text = Annotated[str, msgspec.Meta(max_length=4000, pattern=_PRINTABLE)]
"""A sentence for people: up to 4000 printable characters on one line."""

Data = Annotated[bytes, msgspec.Meta(max_length=LONGEST_MESSAGE)]
"""Bytes that no core reads."""

Tree = Annotated[dict[str, Any], msgspec.Meta(max_length=16)]
"""Maps, lists, texts, numbers, booleans and nil, such as a table of a scenario file; no core reads it, and `check_tree`
bounds it."""

TREE_DEPTH = 8
"""Most levels of a tree."""

TREE_SIZE = 4000
"""Most values in a tree."""

MOST_COUNT = 2**53 - 1
"""Largest `Count`."""

Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_COUNT)]
"""A tick, a sequence number, an epoch: never negative, and exact as a float too."""

LATEST = 1e9
"""Largest `Time` (s)."""

Time = Annotated[float, msgspec.Meta(ge=0.0, le=LATEST)]
"""Run time or waiting time (s): up to 30 years."""

Age = Annotated[float, msgspec.Meta(ge=-1.0, le=LATEST)]
"""Age (s); -1 if there is none."""

Rating = Annotated[float, msgspec.Meta(gt=0.0, le=1e9)]
"""Rating (W): positive, at most a gigawatt."""

Power = Annotated[float, msgspec.Meta(ge=-1e11, le=1e11)]
"""Power (W or var): up to 100 times the largest rating, the widest bound of an agent's set-points."""

Factor = Annotated[float, msgspec.Meta(ge=0.0, le=1e3)]
"""Factor on a power: never negative, and up to a thousand."""

NominalVoltage = Annotated[float, msgspec.Meta(gt=0.0, le=1e5)]
"""Nominal voltage (V, line-to-neutral) of an inverter's terminals: at most 100 kV."""

Voltage = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
"""Voltage (V, line-to-neutral RMS): up to 10 times the highest nominal voltage."""

NominalFrequency = Annotated[float, msgspec.Meta(ge=1.0, le=1000.0)]
"""Nominal frequency (Hz): 16.7, 50, 60 and 400 are in use."""

Frequency = Annotated[float, msgspec.Meta(ge=0.0, le=2000.0)]
"""Frequency (Hz): from standstill to twice the highest nominal frequency."""

Droop = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]
"""Droop (pu per pu), positive; at 1, full power would take the whole frequency, or voltage."""

Cycles = Annotated[float, msgspec.Meta(ge=-2e12, le=2e12)]
"""Angle (cycles): the largest frequency error over the longest time."""

MOST_SHARED = 16
"""Most values that a law may share beside its set-points."""

SHARED_LIMIT = 1e12
"""Largest absolute value of a shared number."""

Shared = Annotated[
    dict[
        Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,31}\Z")],
        Annotated[float, msgspec.Meta(ge=-SHARED_LIMIT, le=SHARED_LIMIT)],
    ],
    msgspec.Meta(max_length=MOST_SHARED),
]
"""Values that a law shares, by names of its own choice."""

MOST_INVERTERS = 1000
"""Most inverters in a run: one row of telemetry on more would not fit into a message."""

Names = Annotated[tuple[Name, ...], msgspec.Meta(max_length=MOST_INVERTERS)]
"""Names of inverters or processes."""

QuickNames = Annotated[tuple[QuickName, ...], msgspec.Meta(max_length=MOST_INVERTERS)]
"""The same, checked together."""

_PATTERN = re.compile(NAME)

_TEXT = re.compile(_PRINTABLE)


def is_name(text: str) -> bool:
    return _PATTERN.fullmatch(text) is not None


@lru_cache(maxsize=4096)
def check_names(*names: str) -> None:
    """Raise ValueError for a bad name; cached, because a sender's names are the same each time."""
    if not all(map(is_name, names)):
        raise ValueError(f"a name is not 1 to 64 letters, digits, _, - or .: {', '.join(map(ascii, names))[:100]}")


def check_tree(tree: Any) -> None:
    """Check that a tree is finite, printable, at most `TREE_DEPTH` deep, and has at most `TREE_SIZE` values."""
    level, size = [tree], 0
    for _ in range(TREE_DEPTH):
        inner: list[Any] = []
        for value in level:
            size += 1
            if isinstance(value, dict):
                if not all(isinstance(key, str) for key in value):
                    raise ValueError("a key in it is no text")
                inner += [*value, *value.values()]
            elif isinstance(value, list | tuple):
                inner += value
            elif isinstance(value, str):
                if len(value) > 4000 or not _TEXT.match(value):
                    raise ValueError(f"a text in it is too long, or not printable: {ascii(value)[:100]}")
            elif isinstance(value, int | float):
                if not isfinite(value):
                    raise ValueError("a number in it is not finite")
            elif value is not None:
                raise ValueError(f"a value in it is no text, number, boolean, list or map: {ascii(value)[:100]}")
        level = inner
        if size + len(level) > TREE_SIZE:
            raise ValueError(f"more than {TREE_SIZE} values are in it")
    if level:
        raise ValueError(f"more than {TREE_DEPTH} levels are in it")
