"""The lines that change a relay while it runs."""

from __future__ import annotations

from netem.relay.direction import Faults
from wire.schema.table_schema import fields_of

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

DIRECTIONS = ("there", "back")
"""From whoever connects to the relay to its target, and back."""

FAULTS = tuple(field.name for field in fields_of(Faults))


class RelayCommandError(ValueError):
    """A line that is no command of a relay; the message says what would be one."""


def new_faults(line: str) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the values of faults in a line, and the directions that get them; raise RelayCommandError if it is none.

    Examples
    --------
    >>> new_faults("delay 0.2 jitter 0.05 back")
    ({'delay': 0.2, 'jitter': 0.05}, ('back',))
    >>> new_faults("delay fast")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    netem.relay.relay_command.RelayCommandError: delay: "fast" is no number; write e.g. "delay 0.2" ...
    """
    words = line.split()
    directions: tuple[str, ...] = DIRECTIONS
    if words and words[-1] in DIRECTIONS:
        directions = (words.pop(),)
    if not words or len(words) % 2 or any(name not in FAULTS for name in words[::2]):
        known = ", ".join((*FAULTS, "stall", "reset", "cut", "heal", "show", "end"))
        raise RelayCommandError(f'"{line.strip()}" is not understood; a line begins with one of {known}')
    return {name: number(name, text) for name, text in zip(words[::2], words[1::2], strict=True)}, directions


def number(name: str, text: str) -> float:
    """Return the number of a fault or of a stall in a line."""
    try:
        value = float(text)
    except ValueError:
        raise RelayCommandError(
            f'{name}: "{text}" is no number; write e.g. "{name} 0.2" (units: s, bytes/s, probability)'
        ) from None
    if name == "stall" and not value >= 0.0:
        raise RelayCommandError(f"stall: a duration is positive, got {value:g} s")
    return value
