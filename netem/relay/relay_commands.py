"""The lines that change a relay while it runs."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Literal, NamedTuple

from netem.relay.bottleneck import NEVER
from netem.relay.faults import Faults

DIRECTIONS = ("there", "back")
"""From who connects to the relay to what the relay connects to, and back."""

HELP = """\
delay S | jitter S | rate BYTES_PER_S | queue BYTES | loss P | reorder P
                several on a line count together; at its end "there" or "back" for one direction, else both
stall [S]       nothing is forwarded for S seconds, or until heal; connections stay, what comes is kept
reset           TCP: close all connections with RST. UDP: forget who talked, as a NAT box that restarts
cut             TCP: reset, and refuse new connections. UDP: drop everything. Until heal
heal            end a stall and a cut
show            say what is set and what was counted
end             end the relay
"""

BARE = ("reset", "cut", "heal", "show", "end")
_FAULTS = tuple(field.name for field in fields(Faults))


class WordError(ValueError):
    """A line that a relay does not understand."""


class Change(NamedTuple):
    """New values of faults."""

    values: dict[str, float]
    directions: tuple[str, ...]

    def on(self, faults: Faults) -> Faults:
        """The faults with the new values; FaultsError if they cannot be meant."""
        return replace(faults, **self.values)


class Stall(NamedTuple):
    """Stop forwarding."""

    duration: float
    """s."""


Word = Change | Stall | Literal["reset", "cut", "heal", "show", "end"]


def read(line: str) -> Word:
    """Read a line.

    Raises
    ------
    WordError
        If it is none of those in `HELP`; the message says what would be.

    Examples
    --------
    >>> read("delay 0.2 jitter 0.05 back")
    Change(values={'delay': 0.2, 'jitter': 0.05}, directions=('back',))
    >>> read("stall 3")
    Stall(duration=3.0)
    >>> read("delay fast")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    netem.relay.relay_commands.WordError: delay: "fast" is no number; write e.g. "delay 0.2" ...
    """
    words = line.split()
    if len(words) == 1:
        for bare in BARE:
            if words[0] == bare:
                return bare  # type: ignore[return-value]  # one of the literals
    if words[:1] == ["stall"] and len(words) <= 2:
        duration = _number("stall", words[1]) if len(words) == 2 else NEVER
        if duration < 0.0:
            raise WordError(f"stall: a duration is positive, got {duration:g} s")
        return Stall(duration)
    directions: tuple[str, ...] = DIRECTIONS
    if words and words[-1] in DIRECTIONS:
        directions = (words.pop(),)
    if not words or len(words) % 2 or any(name not in _FAULTS for name in words[::2]):
        known = ", ".join((*_FAULTS, "stall", *BARE))
        raise WordError(f'"{line.strip()}" is not understood; a line begins with one of {known}')
    return Change({name: _number(name, value) for name, value in zip(words[::2], words[1::2], strict=True)}, directions)


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise WordError(
            f'{name}: "{text}" is no number; write e.g. "{name} 0.2" (units: s, bytes/s, probability)'
        ) from None
