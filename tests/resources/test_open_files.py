"""``ulimit -n``: a process that may have too few files open says so, before Zenoh refuses links without a word."""

from __future__ import annotations

import errno
import resource
from pathlib import Path

import pytest

from gridpeers.wire.driver.machine import BESIDE_LINKS, MOST_FILES, limit, links_objection, raise_limit, too_few_files
from tests.toy import toy_plant
from tests.toy.toy_configs import toy_configs
from tests.toy.toy_runs import ProcessRun

FEW = 14

LIMITED = (
    "import resource, runpy, sys; n = int(sys.argv[1]); resource.setrlimit(resource.RLIMIT_NOFILE, (n, n));"
    "sys.argv = sys.argv[2:]; runpy.run_path(sys.argv[0], run_name='__main__')"
)
"""Runs a script that may have so many files open."""


def test_a_plant_with_too_few_files_for_its_links_ends_the_run_in_one_line(tmp_path: Path) -> None:
    """The run says how many the plant may have, how many it needs, and what to type."""
    run = ProcessRun(*toy_configs(3), tmp_path)
    outcome = run(plant_command=("-c", LIMITED, str(FEW), toy_plant.__file__))

    assert run.rows == []
    assert f"plant: may have {FEW} files open at once, and needs {4 + BESIDE_LINKS}: 4 links" in outcome.broke
    assert "ulimit -n 1024" in outcome.broke
    assert "Traceback" not in outcome.broke


def test_a_limit_is_raised_as_far_as_anybody_may(monkeypatch: pytest.MonkeyPatch) -> None:
    """Up to the hard limit, and to what any run needs; never down."""
    for before, after in (((64, 4096), 4096), ((64, 10**9), MOST_FILES), ((64, 64), None), ((10**6, 10**6), None)):
        found: list[tuple[int, tuple[int, int]]] = []
        monkeypatch.setattr(resource, "getrlimit", lambda kind, before=before: before)
        monkeypatch.setattr(resource, "setrlimit", lambda kind, limits, found=found: found.append((kind, limits)))
        raise_limit()

        assert [limits for _, limits in found] == ([] if after is None else [(after, before[1])])
        assert limit() == before[0]


def test_what_to_do_about_open_files_is_said_of_that_error_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Any other error of the system keeps its own words."""
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (28, 28))

    assert "this process may have 28; raise the limit" in too_few_files(OSError(errno.EMFILE, "Too many open files"))
    assert too_few_files(OSError(errno.ENOSPC, "No space left on device")) == ""
    assert too_few_files(ValueError("x")) == ""
    assert links_objection("plant", 28 - BESIDE_LINKS) == ""
    said = links_objection("plant", 29 - BESIDE_LINKS)
    assert said.startswith("plant: may have 28 files open at once, and needs 29")
