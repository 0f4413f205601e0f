"""The figures of a run."""

import logging


def _is_relevant(record: logging.LogRecord) -> bool:
    """Return False for matplotlib's warning that it cannot write its folder in the user's home."""
    return "MPLCONFIGDIR" not in record.msg and not record.msg.startswith("mkdir -p failed")


logging.getLogger("matplotlib").addFilter(_is_relevant)
