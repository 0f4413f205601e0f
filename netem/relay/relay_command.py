"""The commands that change a relay while it runs, one a line."""

from __future__ import annotations

import msgspec

from netem.relay.direction import Faults
from netem.relay.packets import NEVER
from wire.table_schema import fields_of

DIRECTIONS = ("there", "back")
"""From whoever connects to the relay to its target, and back."""

HELP = """\
delay S | jitter S | rate BYTES_PER_S | queue BYTES | loss P | reorder P
                several on a line count together; at its end "there" or "back" for one direction, else both
stall [S]       nothing is forwarded for S seconds, or until heal; connections stay, what comes is kept
reset           TCP: close all connections with RST. UDP: forget all senders, as a NAT box that restarts
cut             TCP: reset, and refuse new connections. UDP: drop everything. Until heal
heal            end a stall and a cut
show            print the faults and the counts
end             end the relay
"""

ALONE = ("reset", "cut", "heal", "show", "end")
"""Commands without a value."""

FAULTS = tuple(field.name for field in fields_of(Faults))


class RelayCommandError(ValueError):
    """A line that is no command of a relay."""


class RelayCommand(msgspec.Struct, frozen=True):
    """A command."""

    name: str
    """One of `ALONE`, "stall" or "set"."""
    duration: float = NEVER
    """Of a stall (s)."""
    values: dict[str, float] = {}
    """New values of faults."""
    directions: tuple[str, ...] = DIRECTIONS
    """Directions that get them."""


def read_command(line: str) -> RelayCommand:
    """Read a command.

    Raises
    ------
    RelayCommandError
        If it is none of those in `HELP`; the message says what would be.

    Examples
    --------
    >>> command = read_command("delay 0.2 jitter 0.05 back")
    >>> command.values, command.directions
    ({'delay': 0.2, 'jitter': 0.05}, ('back',))
    >>> read_command("stall 3").duration
    3.0
    >>> read_command("delay fast")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    netem.relay.relay_command.RelayCommandError: delay: "fast" is no number; write e.g. "delay 0.2" ...
    """
    match line.split():
        case [name] if name in ALONE:
            return RelayCommand(name)
        case ["stall"]:
            return RelayCommand("stall")
        case ["stall", text]:
            duration = _number("stall", text)
            if not duration >= 0.0:
                raise RelayCommandError(f"stall: a duration is positive, got {duration:g} s")
            return RelayCommand("stall", duration)
        case [*pairs, direction] if direction in DIRECTIONS:
            directions: tuple[str, ...] = (direction,)
        case pairs:
            directions = DIRECTIONS
    if not pairs or len(pairs) % 2 or any(name not in FAULTS for name in pairs[::2]):
        known = ", ".join((*FAULTS, "stall", *ALONE))
        raise RelayCommandError(f'"{line.strip()}" is not understood; a line begins with one of {known}')
    values = {name: _number(name, text) for name, text in zip(pairs[::2], pairs[1::2], strict=True)}
    return RelayCommand("set", values=values, directions=directions)


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise RelayCommandError(
            f'{name}: "{text}" is no number; write e.g. "{name} 0.2" (units: s, bytes/s, probability)'
        ) from None
