"""The status of a run folder whose run ends early: by a signal, by an error, or with its output."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gridpeers.scenarios.results.run_files import refusal, set_broken
from gridpeers.wire.driver.output import OutputLostError


class TerminatedError(KeyboardInterrupt):
    """Somebody ended the command by SIGTERM; it closes as after Ctrl-C."""


@contextmanager
def broken_if_ended(folder: Path) -> Iterator[None]:
    """Set the status of a run folder to "broken: why" if what is inside does not come to its end."""
    try:
        yield
    except KeyboardInterrupt as error:
        set_broken(folder, f"interrupted {'by SIGTERM' if isinstance(error, TerminatedError) else 'from the keyboard'}")
        raise
    except OSError as error:
        set_broken(folder, refusal(folder, error))
        raise
    except (Exception, OutputLostError) as error:
        set_broken(folder, str(error) or type(error).__name__)
        raise
