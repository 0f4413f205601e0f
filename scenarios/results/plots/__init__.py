"""The figures of a run."""

import logging


def _is_no_note_on_its_folder(record: logging.LogRecord) -> bool:
    """Whether a line of matplotlib's log is another than that its folder in the user's home cannot be written."""
    return "MPLCONFIGDIR" not in record.msg and not record.msg.startswith("mkdir -p failed")


logging.getLogger("matplotlib").addFilter(_is_no_note_on_its_folder)
