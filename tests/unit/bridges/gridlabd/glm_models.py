"""Models for GridLAB-D that the tests import, and the voltages of both sides."""

from __future__ import annotations

from pathlib import Path

from gridpeers.bridges.gridlabd.glm import read_tables, write_tables
from gridpeers.bridges.gridlabd.glm_elements import voltages_of
from gridpeers.bridges.gridlabd.glm_network import network_blocks
from gridpeers.bridges.gridlabd.glm_text import GlmText
from gridpeers.bridges.gridlabd.read_glm import read_glm, solved_model
from gridpeers.plant.equipment import Tables
from gridpeers.plant.network import Network, solve_power_flow

TOLERANCE = 1e-6  # largest difference that the tests allow (pu of nominal voltage)
CLOCK = """clock { timezone UTC0; starttime '2000-01-01 00:00:00'; stoptime '2000-01-01 00:00:01'; }
module powerflow { solver_method NR; line_capacitance true; line_limits false; default_maximum_voltage_error 1e-11; }
"""
HEAD = """clock { timezone UTC0; starttime '2000-01-01 00:00:00'; stoptime '2000-01-02 00:00:00'; }
module powerflow { solver_method NR; line_capacitance true; }
object node { name sub; phases ABCN; bustype SWING; nominal_voltage 7200;
  voltage_A 7300; voltage_B -3650-6321.985447626403j; voltage_C -3650+6321.985447626403j; }
object line_configuration { name uneven; z11 0.35+1.02j; z12 0.16+0.50j; z13 0.15+0.42j; z21 0.16+0.50j; z22 0.34+1.05j;
  z23 0.15+0.38j; z31 0.15+0.42j; z32 0.15+0.38j; z33 0.36+1.03j; c11 17; c12 -5; c22 16; c21 -5; c33 15; }
object overhead_line { name head; phases ABCN; from sub; to b; length 5280; configuration uneven; }
object node { name b; phases ABCN; nominal_voltage 7200; }
"""
"""Begins a model: a substation, a line and bus b."""

SECONDARY = """object transformer_configuration { name t_SHORT; connect_type CONNECT; power_rating 500;
  primary_voltage 7200; secondary_voltage 277; resistance 0.01; reactance 0.04; }
object transformer { name SHORT; phases ABCPHASE; from b; to c_SHORT; configuration t_SHORT; }
object load { name c_SHORT; phases ABCPHASE; nominal_voltage 277; LOAD }
"""

WYE = "constant_power_A 60000+20000j; constant_current_B 150-60j; constant_impedance_C 1.5+0.5j;"
CENTRE_TAP = """object transformer_configuration { name ct; connect_type SINGLE_PHASE_CENTER_TAPPED; power_rating 25;
  powerB_rating 25; primary_voltage 7200; secondary_voltage 120; impedance 0.006+0.0136j; impedance1 0.012+0.0204j;
  impedance2 0.012+0.0204j; shunt_impedance 5000+2000j; }
object transformer { name tap; phases BS; from b; to tn; configuration ct; }
object triplex_node { name tn; phases BS; nominal_voltage 120; current_12 3-1j; }
object triplex_line_conductor { name tc; resistance 0.57; geometric_mean_radius 0.0111; }
object triplex_line_configuration { name tlc; conductor_1 tc; conductor_2 tc; conductor_N tc;
  insulation_thickness 0.08; diameter 0.368; }
object triplex_line { name service; phases BS; from tn; to tm; length 100; configuration tlc; }
object triplex_meter { name tm; phases BS; nominal_voltage 120; }
object triplex_load { name home; phases BS; nominal_voltage 120; parent tm; constant_power_1 5000+1000j;
  constant_current_2 20-3j; constant_impedance_12 12+2j; }
object triplex_load { name zip; phases BS; nominal_voltage 120; parent tm; base_power_12 3000; power_pf_12 0.95;
  current_pf_12 0.9; impedance_pf_12 1; power_fraction_12 0.5; current_fraction_12 0.3; impedance_fraction_12 0.2; }
"""

TRANSFORMERS = "".join(  # transformers of every connection, a centre-tapped one with its service, a regulator
    [
        HEAD,
        *(
            SECONDARY.replace("SHORT", short).replace("CONNECT", connect).replace("PHASE", phase).replace("LOAD", load)
            for short, connect, phase, load in (
                ("yy", "WYE_WYE", "N", WYE),
                ("dgy", "DELTA_GWYE", "N", WYE),
                ("dd", "DELTA_DELTA", "D", WYE.replace("_C", "_B").replace("_B 1", "_C 1")),
            )
        ),
        CENTRE_TAP,
        """object transformer_configuration { name t_1; connect_type SINGLE_PHASE; power_rating 100; powerC_rating 100;
  primary_voltage 7200; secondary_voltage 240; resistance 0.01; reactance 0.03; }
object transformer { name one; phases CN; from b; to c_1; configuration t_1; }
object load { name c_1; phases CN; nominal_voltage 240; constant_power_C 40000+9000j; }
object regulator_configuration { name rc; connect_type WYE_WYE; Control MANUAL; Type B; raise_taps 16; lower_taps 16;
  regulation 0.1; tap_pos_A 7; tap_pos_B -3; tap_pos_C 4; }
object regulator { name reg; phases ABCN; from b; to r; configuration rc; }
object node { name r; phases ABCN; nominal_voltage 7200; }
object load { name at_r; phases ABCN; parent r; nominal_voltage 7200; constant_power_A 1e5+3e4j; }
""",
    ]
)

LOADS = (  # loads of every kind and connection, at buses of either connection, and capacitors
    HEAD
    + """object load { name wye; phases ABCN; parent b; nominal_voltage 7200; constant_power_A 1e5+3e4j;
  constant_current_B -4-10j; constant_impedance_C 500+150j; }
object load { name delta; phases ABCD; parent b; nominal_voltage 7200; constant_power_A 9e4+3e4j;
  constant_current_B -1-8j; constant_impedance_C 1500+450j; }
object load { name explicit; phases ABCN; parent b; nominal_voltage 7200; constant_power_AB 8e4+2e4j;
  constant_current_BN -3-7j; constant_impedance_CA 1800+200j; constant_impedance_BN 900+200j; }
object load { name zip; phases ABCN; parent b; nominal_voltage 7200; base_power_B 90000; power_pf_B 0.9;
  current_pf_B 0.95; impedance_pf_B -0.97; power_fraction_B 0.2; current_fraction_B 0.5; impedance_fraction_B 0.3; }
object node { name d; phases ABCD; nominal_voltage 7200; }
object underground_line { name cable; phases ABC; from b; to d; length 2000; configuration uneven; }
object load { name at_d; phases ABCN; parent d; nominal_voltage 7200; constant_power_B 7e4+3e4j; }
object load { name own_d; phases ABCD; parent d; nominal_voltage 7200; constant_current_C -5+6j; }
object capacitor { name bank; parent b; phases ABCN; phases_connected ABCN; nominal_voltage 7200; control MANUAL;
  capacitor_A 60000; capacitor_B 50000; capacitor_C 40000; switchA CLOSED; switchB CLOSED; switchC OPEN; }
object capacitor { name mixed; parent b; phases ABCN; phases_connected ABCD; nominal_voltage 7200; control MANUAL;
  capacitor_A 60000; capacitor_B 50000; capacitor_C 40000; switchA CLOSED; switchB OPEN; switchC CLOSED; }
object capacitor { name around; parent d; phases ABCD; phases_connected ABCD; nominal_voltage 7200; control MANUAL;
  capacitor_A 60000; capacitor_B 50000; capacitor_C 40000; switchA CLOSED; switchB CLOSED; switchC CLOSED; }
"""
)

SWITCHES = (  # switches that are open and closed, a recloser, a fuse
    HEAD
    + """object switch { name sw; phases ABCN; from b; to nc; status CLOSED; }
object load { name nc; phases ABCN; nominal_voltage 7200; constant_power_A 1e5+3e4j; constant_power_C 5e4; }
object recloser { name rec; phases ABCN; from nc; to ne; }
object load { name ne; phases ABCN; nominal_voltage 7200; constant_power_B 8e4+3e4j; }
object switch { name tie; phases ABCN; from ne; to nf; status OPEN; }
object overhead_line { name back; phases ABCN; from b; to nf; length 3000; configuration uneven; }
object load { name nf; phases ABCN; nominal_voltage 7200; constant_power_B 3e4+2e4j; }
object fuse { name lateral; phases AN; from nf; to ng; current_limit 1000; }
object load { name ng; phases AN; nominal_voltage 7200; constant_power_A 3e4+2e4j; }
"""
)

ASYMMETRIC = (  # lines with z12 unlike z21, in a ring with a switch, with an open end
    HEAD.replace("z21 0.16+0.50j", "z21 0.26+0.30j")
    .replace("z31 0.15+0.42j", "z31 0.05+0.60j")
    .replace("z32 0.15+0.38j", "z32 0.22+0.45j")
    + """object overhead_line { name one; phases ABCN; from b; to ring; length 9000; configuration uneven; }
object overhead_line { name two; phases ABCN; from b; to far; length 7000; configuration uneven; }
object switch { name tie; phases ABCN; from far; to end; status CLOSED; }
object overhead_line { name three; phases ABCN; from end; to ring; length 4000; configuration uneven; }
object node { name ring; phases ABCN; nominal_voltage 7200; }
object node { name far; phases ABCN; nominal_voltage 7200; }
object load { name at_far; phases ABCN; parent far; nominal_voltage 7200; constant_power_A 1.2e5+3e4j;
  constant_current_B -4-10j; constant_impedance_C 500+150j; }
object load { name end; phases ABCN; nominal_voltage 7200; constant_power_B 2e5+6e4j; constant_power_C 5e4+1e4j; }
object overhead_line { name open_end; phases ABCN; from ring; to nothing; length 3000; configuration uneven; }
object node { name nothing; phases ABCN; nominal_voltage 7200; }
"""
    + SECONDARY.replace("SHORT", "low").replace("CONNECT", "WYE_WYE").replace("PHASE", "N").replace("LOAD", WYE)
)


def write(folder: Path, text: str, name: str = "feeder.glm") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def network_model(feeder: Tables, folder: Path) -> str:
    """Return the network of a feeder of our own tables as a model that is solved once."""
    write_tables(feeder, folder)
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    return CLOCK + "\n".join(network_blocks(read_tables(folder), feeder.load_set, V_nom, ()))


def gridlabd_voltages(path: Path) -> dict[tuple[str, str], complex]:
    """Voltage (V) of each node as GridLAB-D has it; A and B are the legs of a split-phase service."""
    buses = solved_model(path, GlmText(path))["buses"]
    return {(bus["name"], letter): V for bus in buses for letter, V in voltages_of(bus).items()}


def largest_difference(path: Path, leave_out: tuple[str, ...] = ()) -> tuple[float, int]:
    """Largest difference between GridLAB-D's voltages and ours (pu), and over how many nodes."""
    theirs = gridlabd_voltages(path)
    network = Network(read_glm(path, leave_out=leave_out))
    solved = solve_power_flow(network, network.closed0)
    ours = {node: (V, V_nom) for node, V, V_nom in zip(network.nodes, solved, network.V_nom, strict=True)}
    return max(abs(ours[node][0] - V) / ours[node][1] for node, V in theirs.items()), len(theirs)
