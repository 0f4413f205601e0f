"""The page beside a run: `python -m gridpeers.viewer.recorded`, as `gridpeers run --view` starts it."""

import sys

from gridpeers.viewer.recorded.page_process import PageConfig, serve
from gridpeers.wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("gridpeers.viewer.recorded", "Serve the page of a run that is recorded.", PageConfig, serve))
