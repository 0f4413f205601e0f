"""All parts of the cross-validation, in the order of the page. A new part is one file, and its line here."""

from __future__ import annotations

from bench.validation.autotests_part import AUTOTESTS
from bench.validation.convergence_part import CONVERGENCE
from bench.validation.grid_forming_part import GRID_FORMING
from bench.validation.gridlabd_part import GRIDLABD
from bench.validation.power_flow_part import POWER_FLOW
from bench.validation.random_feeders_part import RANDOM_FEEDERS
from bench.validation.validation_part import ValidationPart

PARTS: tuple[ValidationPart, ...] = (POWER_FLOW, GRIDLABD, AUTOTESTS, GRID_FORMING, CONVERGENCE, RANDOM_FEEDERS)
