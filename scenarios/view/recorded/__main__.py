"""The process of a page beside a run: `python -m scenarios.view.recorded`, as `gridpeers run --view` starts it."""

import sys

from scenarios.view.recorded.page_process import PageConfig, serve
from wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("scenarios.view.recorded", "Serve the page of a run that is recorded.", PageConfig, serve))
