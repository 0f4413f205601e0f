"""The figures of a run."""

import logging

# keeps back matplotlib's warning that it cannot write its folder in the user's home
logging.getLogger("matplotlib").addFilter(
    lambda record: "MPLCONFIGDIR" not in record.msg and not record.msg.startswith("mkdir -p failed")
)
