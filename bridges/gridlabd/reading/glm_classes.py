"""Classes of GridLAB-D's objects, by what becomes of them."""

from __future__ import annotations

CHILD_OF_BUS = ("node", "load", "meter", "triplex_node", "triplex_meter", "triplex_load", "capacitor", "substation")
"""Classes that can take power where they are connected. `pqload` can, too, but is refused."""

SWITCHES = frozenset({"switch", "recloser", "sectionalizer"})
"""Classes that open and close: ideal switches before what they have of impedance."""

LINES = frozenset({"overhead_line", "underground_line", "triplex_line", "line"})
"""Classes of lines."""

LINEAR = LINES | {"transformer", "regulator", "fuse", "series_reactor"}
"""Classes that an admittance matrix describes."""

DATA = frozenset(
    [
        "line_configuration",
        "line_spacing",
        "overhead_line_conductor",
        "underground_line_conductor",
        "triplex_line_conductor",
        "triplex_line_configuration",
        "transformer_configuration",
        "regulator_configuration",
    ]
)
"""Classes that others refer to."""

WATCHING = frozenset(
    [
        *("recorder", "multi_recorder", "group_recorder", "collector", "histogram", "violation_recorder"),
        *("voltdump", "currdump", "impedance_dump", "jsondump", "billdump", "load_tracker", "emissions"),
        *("assert", "double_assert", "complex_assert", "enum_assert", "int_assert", "string_assert"),
        *("metrics", "power_metrics", "metrics_collector", "metrics_collector_writer"),
        *("climate", "weather", "csv_reader", "fault_check", "eventgen", "restoration"),
    ]
)
"""Classes that measure, or act only later or on what is refused anyway: they have no part in the network."""

CONTROLS = frozenset({"volt_var_control"})
"""Controls that may have acted at the first moment; afterwards what they control stays."""

GENERATION = frozenset(
    [
        *("inverter", "inverter_dyn", "inverter_DYN", "solar", "battery", "energy_storage", "diesel_dg"),
        *("windturb_dg", "rectifier", "sync_ctrl", "controller_dg", "dc_dc_converter", "central_dg", "microturbine"),
    ]
)
"""Classes whose place an inverter of ours can take."""
