"""Faults in the kernel, by the command `tc` (iproute2): real TCP and UDP on a link that is really bad.

Where the kernel has the queueing discipline netem, it does everything. Where it has not, packets can still be lost (by
a BPF filter) and slowed down (by a token bucket); for the rest there is `netem.relay`. See `docs/netem.md`.
"""

from netem.tc.commands import Step, TcError, netem_steps, steps_without_netem
from netem.tc.device import Impaired, try_out, why_no_netem

__all__ = ["Impaired", "Step", "TcError", "netem_steps", "steps_without_netem", "try_out", "why_no_netem"]
