"""Parameters of inverters in the model that GridLAB-D reads."""

from typing import Any, Literal, get_args, get_origin

import pytest
from msgspec.structs import replace

from gridpeers.bridges.gridlabd.glm import inverter_blocks
from gridpeers.bridges.gridlabd.gridlabd_simulator import beyond_gridlabd
from gridpeers.plant.equipment.inverter_parameters import BOUNDS_OF_SET_POINTS, PARAMETERS_OF
from gridpeers.wire.schema.table_schema import Field, fields_of

ROW = {"name": "inv1", "bus": "13", "P_rated_kW": "600", "m_p_pu": "0.01", "m_q_pu": "0.05"}
KEYS = [
    (kind, field)
    for kind, cls in PARAMETERS_OF.items()
    for field in fields_of(cls)
    if field.name not in BOUNDS_OF_SET_POINTS  # they bound set-points before GridLAB-D gets them
]


def another(field: Field) -> Any:
    """Return another value of a parameter than its default."""
    if field.type is bool:
        return not field.default
    if get_origin(field.type) is Literal:
        return next(word for word in get_args(field.type) if word != field.default)
    return 0.5 * field.default or 0.01


@pytest.mark.parametrize(("kind", "field"), KEYS, ids=[f"{kind}-{field.key}" for kind, field in KEYS])
def test_a_parameter_is_written_or_refused(kind: str, field: Field) -> None:
    """Another value of any parameter makes another model; one that GridLAB-D does not have is named by its key."""
    default = PARAMETERS_OF[kind]()
    own = replace(default, **{field.name: another(field)})

    models = [inverter_blocks([ROW], {"inv1": 1e5 + 0j}, {"inv1": parameters}) for parameters in (default, own)]

    assert (models[0] != models[1]) != (field.key in beyond_gridlabd(own))
    assert beyond_gridlabd(default) == {}
