"""The end of a run by hand: its account, and the one line in its folder on how it ended."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Console

from scenarios.live.live_folders import Folders
from scenarios.live.live_processes import ProcessOutcome
from scenarios.live.numbers.live_report import LiveReport
from scenarios.results.report import show
from wire.driver.drive import StoppedError


def conclude(ended: ProcessOutcome, account: LiveReport, kept: Folders) -> ProcessOutcome:
    """Give account of a run that has ended, show it, and note how it ended.

    Ctrl-C and SIGTERM are as good an end as any: the run has no other. Only a second one leaves it without numbers.

    Parameters
    ----------
    ended : ProcessOutcome
        How the run ended.
    account : LiveReport
        With the record, if that is whole.
    kept : Folders
        With the run folder.
    """
    if ended.broke or not account.ready:
        kept.broken(ended.broke or "no whole record")
        return ended
    try:
        show(account.write(), Console())
        kept.complete()
    except (StoppedError, KeyboardInterrupt) as stop:
        kept.broken("interrupted while its numbers were made")
        return replace(ended, interrupted=str(stop) or "SIGINT")
    except OSError as error:
        broke = f"its numbers cannot be written: {error.strerror or error}"
        kept.broken(broke)
        return replace(ended, broke=broke)
    return ended
