"""The page beside a run: `python -m gridpeers.scenarios.view.recorded`, as `gridpeers run --view` starts it."""

import sys

from gridpeers.scenarios.view.recorded.page_process import PageConfig, serve
from gridpeers.wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("gridpeers.scenarios.view.recorded", "Serve the page of a run that is recorded.", PageConfig, serve))
