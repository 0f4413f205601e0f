"""The head of a GLM that runs in delta mode from its second second on."""

from __future__ import annotations

START = 946684800
"""GridLAB-D's clock at the start of the model (s since 1970): 2000-01-01. Delta mode begins one second later."""


def delta_header(h: float, seconds: int, bus: str, *powerflow: str) -> str:
    """Write clock, modules and what finds islands.

    The recorder of a bus, into nowhere, keeps the clock going: without anything that wants to be called again GridLAB-D
    stops at once.

    Parameters
    ----------
    h
        Step (s).
    seconds
        How long delta mode may run (s).
    bus
        Name of any node.
    powerflow
        Further settings of the module.
    """
    step = round(h * 1e9)
    enabled = f"enable_subsecond_models true;\n\tdeltamode_timestep {step};"
    settings = "".join(f"\n\t{setting};" for setting in powerflow)
    return f"""#set deltamode_forced_always=true
#set deltamode_timestep={step}
#set deltamode_iteration_limit=20
#set minimum_timestep=1
clock {{
	timezone UTC0;
	starttime '2000-01-01 00:00:00';
	stoptime '2000-01-01 00:00:{seconds + 2:02d}';
}}
module tape;
module powerflow {{
	{enabled}
	solver_method NR;
	all_powerflow_delta true;
	line_capacitance false;
	line_limits false;
	NR_island_fail_method true;{settings}
}}
module generators {{
	{enabled}
}}
module reliability {{
	{enabled}
	report_event_log false;
}}
object fault_check {{
	name islands;
	check_mode ONCHANGE;
	strictly_radial false;
	grid_association true;
}}
object recorder {{
	name ticker;
	parent {bus};
	property voltage_A;
	interval 1;
	file "/dev/null";
}}"""
