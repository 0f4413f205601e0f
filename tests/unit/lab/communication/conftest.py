"""The sound run that faults are planted in."""

from __future__ import annotations

import pytest

from gridpeers.scenarios.checks.checked_case import CheckedCase
from tests.unit.scenarios.checks.cases import ran


@pytest.fixture(scope="module")
def sound() -> CheckedCase:
    return ran().checked_case
