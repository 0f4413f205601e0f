"""The processor type for which OpenBLAS computes in tests: that of the pinned histories, where this processor can.

OpenBLAS picks its kernels by the processor that it recognises, and machines of one kind are recognised differently. The
kernels decide the last digits; so without this the bytes would be compared on some machines alone.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

HASHES = Path(__file__).parent / "golden" / "catalogue" / "hashes.toml"

_NEEDED = {"SkylakeX": "avx512f", "Haswell": "avx2"}
"""What a processor must have for the kernels of a type, as Linux names it."""


def choose(processor: Path = Path("/proc/cpuinfo")) -> None:
    """Have this process, if it has not imported numpy yet, and all that it starts use the kernels of the pins."""
    kernels = tomllib.loads(HASHES.read_text(encoding="utf-8"))["environment"]["blas"]
    needed = _NEEDED.get(kernels)
    if needed and processor.is_file() and needed in processor.read_text(encoding="utf-8").split():
        os.environ.setdefault("OPENBLAS_CORETYPE", kernels)
