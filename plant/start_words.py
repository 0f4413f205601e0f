"""What a starting plant says on its standard output, one word a line, to the process that has started it."""

from __future__ import annotations

LISTENING = "listening"
"""Its session is open."""

COMPILING = "compiling"
"""It is being built; its step is compiled first if there is no machine code of it, which takes up to a minute."""

READY = "ready"
"""It waits for agents."""
