"""Own feeder: four buses at 400 V and 50 Hz as tables, and three inverters that share the load.

python examples/own_feeder.py
"""

import tempfile
from pathlib import Path

import gridpeers as gp

TABLES = {
    "feeder.toml": "f_nom_Hz = 50.0\n",
    "buses.csv": """\
bus,phases,V_nom_kV_LL,zone,x,y,origin
grid,ABC,0.4,MG1,0,0,own
east,ABC,0.4,MG1,1,0,own
west,ABC,0.4,MG1,2,0,own
farm,ABC,0.4,MG1,3,0,own
""",
    "line_configs.csv": """\
config,phase_1,phase_2,R_ohm_per_km,X_ohm_per_km,B_uS_per_km
cable,A,A,0.32,0.08,0
cable,A,B,0,0,0
cable,A,C,0,0,0
cable,B,B,0.32,0.08,0
cable,B,C,0,0,0
cable,C,C,0.32,0.08,0
""",
    "lines.csv": """\
line,from_bus,to_bus,phases,config,length_m,origin,note
L1,east,west,ABC,cable,120,own,
L2,west,farm,ABC,cable,200,own,
""",
    "switches.csv": """\
from_bus,to_bus,phases,state,alias,origin,note
grid,east,ABC,closed,main,own,
""",
    "source.csv": "bus,V_pu,angle_deg\ngrid,1,0\n",
    "loads_main.csv": """\
bus,connection,model,P_a_kW,Q_a_kvar,P_b_kW,Q_b_kvar,P_c_kW,Q_c_kvar,origin
west,Y,P,12,3,11,3,13,4,own
farm,Y,Z,8,2,8,2,8,2,own
""",
    "inverters.csv": """\
name,kind,bus,microgrid,P_rated_kW,m_p_pu,m_q_pu,spare
inv1,GFM,east,MG1,50,0.01,0.05,
inv2,GFL,west,MG1,30,0.01,0.05,
inv3,GFM,farm,MG1,20,0.01,0.05,
""",
}

with tempfile.TemporaryDirectory() as folder:
    for name, text in TABLES.items():
        (Path(folder) / name).write_text(text)

    scenario = gp.Scenario(
        name="village",
        time={"end_s": 3.0},
        plant={"feeder": folder},
        event=[{"label": "islanding", "t_s": 1.0, "open": ["main"]}],
        case={
            "droop": {"secondary": "none", "graph": "none"},
            "consensus": {"secondary": "all", "graph": "full"},
        },
    )
    for note in scenario.check():
        print(note)
    runs = scenario.run()
    print(runs.metrics[["f_error_Hz", "MPSI", "V_error"]].round(4))
    runs.plot("frequency").savefig("own_feeder.png")
print("drawn: own_feeder.png")
