"""How hypothesis draws here."""

from __future__ import annotations

from hypothesis import settings

# The same examples every time, and no limit on an example's time, which a busy machine would break.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")
