"""Parts of scripts: elements, loads and generation that the tests solve with both engines."""

from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN

LOADS = """New Load.a bus1=c.1 phases=1 kv=0.277 kw=60 kvar=20 model=1
New Load.bc bus1=c.2.3 phases=1 conn=delta kv=0.48 kw=80 kvar=40 model=5
"""
"""Uneven loads at bus c."""

DELTA_LOADS = """New Load.ab bus1=c.1.2 phases=1 conn=delta kv=0.48 kw=70 kvar=20 model=1
New Load.bc bus1=c.2.3 phases=1 conn=delta kv=0.48 kw=40 kvar=10 model=5
"""
"""Uneven loads at bus c that need no ground."""

T = "New Transformer.t phases=3 windings=2 xhl=4 %loadloss=1 kvs=(12.47 0.48) kvas=(500 500)"
TRANSFORMERS = {
    "wye-wye": f"{T} buses=(b c) conns=(wye wye)\n{LOADS}",
    "delta-wye": f"{T} buses=(b c) conns=(delta wye)\n{LOADS}",
    "delta-wye, leading": f"{T} buses=(b c) conns=(delta wye) leadlag=lead\n{LOADS}",
    "wye-delta": f"{T} buses=(b c) conns=(wye delta)\n{DELTA_LOADS}",
    "wye without ground, delta": f"{T} buses=(b.1.2.3.4 c) conns=(wye delta)\n{DELTA_LOADS}",
    "delta-delta": f"{T} buses=(b c) conns=(delta delta)\n{DELTA_LOADS}",
    "neutral through a resistor": f"{T} buses=(b c.1.2.3.4) conns=(delta wye) wdg=2 rneut=0.1\n{LOADS}",
    "losses, magnetising current": f"{T} buses=(b c) conns=(wye wye) %noloadloss=0.4 %imag=1 taps=(1.02 0.98)\n{LOADS}",
    "open wye, open delta": """New Transformer.t1 phases=1 xhl=3 buses=(b.1.0 c.1.2) kvs=(7.2 0.48) kvas=(200 200)
New Transformer.t2 phases=1 xhl=3 buses=(b.2.0 c.2.3) kvs=(7.2 0.48) kvas=(200 200)
New Reactor.corner bus1=c.2 bus2=c.2.0 phases=1 r=5 x=0.1
New Load.ab bus1=c.1.2 phases=1 conn=delta kv=0.48 kw=70 kvar=20
New Load.d bus1=c phases=3 conn=delta kv=0.48 kw=60 kvar=20
""",
    "centre-tapped": """New Transformer.t phases=1 windings=3 buses=(b.2.0 c.1.0 c.0.2)
~ kvs=(7.2 0.12 0.12) kvas=(25 25 25) xhl=2 xht=2 xlt=1.4 %rs=(0.6 1.2 1.2)
New LineCode.triplex nphases=2 units=kft rmatrix=(0.1 | 0.04 0.1) xmatrix=(0.05 | 0.03 0.05) cmatrix=(1 | 0 1)
New Line.service bus1=c.1.2 bus2=d.1.2 linecode=triplex length=0.1 units=kft
New Load.one bus1=d.1 phases=1 kv=0.12 kw=5 kvar=1
New Load.two bus1=d.2 phases=1 kv=0.12 kw=3 kvar=1
New Load.both bus1=d.1.2 phases=1 conn=delta kv=0.24 kw=6 kvar=1
""",
    "three windings": """New Transformer.t phases=3 windings=3 buses=(b c d) conns=(delta wye delta)
~ kvs=(12.47 0.48 4.16) kvas=(1000 500 500) xhl=5 xht=6 xlt=4
New Load.c bus1=c phases=3 kv=0.48 kw=200 kvar=50
New Load.d bus1=d phases=3 conn=delta kv=4.16 kw=150 kvar=50
""",
    "regulated": f"""New Transformer.r1 phases=1 xhl=0.5 buses=(b.1 r.1) kvs=(7.2 7.2) kvas=(1000 1000)
New Transformer.r2 phases=1 xhl=0.5 buses=(b.2 r.2) kvs=(7.2 7.2) kvas=(1000 1000)
New Transformer.r3 phases=1 xhl=0.5 buses=(b.3 r.3) kvs=(7.2 7.2) kvas=(1000 1000)
New RegControl.c1 transformer=r1 winding=2 vreg=124 band=2 ptratio=60 ctprim=100 r=2 x=1
New RegControl.c2 transformer=r2 winding=2 vreg=118 band=2 ptratio=60 ctprim=100 r=2 x=1
New RegControl.c3 transformer=r3 winding=2 vreg=121 band=2 ptratio=60
{T} buses=(r c) conns=(wye wye)
{LOADS}""",
    "autotransformer": """New AutoTrans.t phases=3 windings=2 buses=(b c) conns=(series wye) kvs=(12.47 4.16)
~ kvas=(1000 1000) xhx=4
New Load.c bus1=c phases=3 kv=4.16 kw=200 kvar=50
""",
}

ELEMENTS = {
    "capacitor, wye": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48",
    "capacitor, delta": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48 conn=delta",
    "capacitor, one phase": "New Capacitor.k bus1=c.2 phases=1 kvar=30 kv=0.277",
    "capacitor, steps": "New Capacitor.k bus1=c phases=3 kvar=(50 50 50) kv=0.48 numsteps=3 states=(1 0 1)",
    "capacitor, controlled": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48\n"
    "New CapControl.x element=Transformer.down terminal=2 capacitor=k type=kvar onsetting=40 offsetting=-80 ctratio=1",
    "capacitor, in series": "New Capacitor.k bus1=c bus2=d phases=3 cuf=50000\n"
    "New Load.d bus1=d phases=3 kv=0.48 kw=40 kvar=10",
    "reactor, shunt": "New Reactor.x bus1=c phases=3 kvar=50 kv=0.48",
    "reactor, delta": "New Reactor.x bus1=c phases=3 kvar=50 kv=0.48 conn=delta",
    "reactor, in series": "New Reactor.x bus1=c bus2=d phases=3 r=0.01 x=0.03\n"
    "New Load.d bus1=d phases=3 kv=0.48 kw=40 kvar=10",
    "fault": "New Fault.f bus1=c.1 phases=1 r=2",
    "disabled": "New Load.off bus1=c phases=3 kv=0.48 kw=200 kvar=50 enabled=no\n"
    "New Capacitor.k bus1=c kvar=100 kv=0.48\nDisable Capacitor.k",
}

LINES = {
    "sequence impedances": "New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.03 x0=0.06 c1=100 c0=50 length=1",
    "phases crossed": "New Line.l bus1=c.1.2.3 bus2=d.2.3.1 r1=0.01 x1=0.02 r0=0.03 x0=0.06 length=1",
    "in parallel": "New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.03 x0=0.06 length=1\n"
    "New Line.m bus1=c bus2=d r1=0.03 x1=0.02 r0=0.05 x0=0.06 length=1",
    "a geometry": """New WireData.w rac=0.306 gmrac=0.0244 radius=0.36 runits=mi gmrunits=ft radunits=in
New LineGeometry.g nconds=4 nphases=3 reduce=yes cond=1 wire=w x=-4 h=28 units=ft cond=2 wire=w x=-1.5 h=28 units=ft
~ cond=3 wire=w x=3 h=28 units=ft cond=4 wire=w x=0 h=24 units=ft
New Line.l bus1=c bus2=d geometry=g length=200 units=ft""",
    "a neutral conductor": """New LineCode.four nphases=4
~ rmatrix=(0.05 | 0.01 0.05 | 0.01 0.01 0.05 | 0.01 0.01 0.01 0.06)
~ xmatrix=(0.08 | 0.03 0.08 | 0.03 0.03 0.08 | 0.03 0.03 0.03 0.09) cmatrix=(1 | 0 1 | 0 0 1 | 0 0 0 1)
New Line.l phases=4 bus1=c.1.2.3.4 bus2=d.1.2.3.4 linecode=four length=0.2
New Reactor.ground bus1=c.4 phases=1 r=0.1 x=0
New Load.n bus1=d.1.4 phases=1 kv=0.277 kw=30 kvar=5""",
}

MODELS = {  # every load model, with what it needs beside its number
    1: "model=1",
    2: "model=2",
    3: "model=3",
    4: "model=4 cvrwatts=0.8 cvrvars=3",
    5: "model=5",
    6: "model=6",
    7: "model=7",
    8: "model=8 zipv=(0.3 0.5 0.2 0.1 0.6 0.3 0)",
}

CONNECTIONS = {
    "three phases, wye": "bus1=c phases=3 conn=wye kv=0.48",
    "three phases, delta": "bus1=c phases=3 conn=delta kv=0.48",
    "two phases, wye": "bus1=c.2.3 phases=2 conn=wye kv=0.48",
    "two phases, open delta": "bus1=c.1.2.3 phases=2 conn=delta kv=0.48",
    "one phase to ground": "bus1=c.2 phases=1 conn=wye kv=0.277",
    "from ground to one phase": "bus1=c.0.2 phases=1 conn=wye kv=0.277",
    "between two phases": "bus1=c.3.1 phases=1 conn=delta kv=0.48",
    "between two phases, called wye": "bus1=c.1.2 phases=1 conn=wye kv=0.48",
    "phases in another order": "bus1=c.3.1.2 phases=3 conn=wye kv=0.48",
}

RANGES = {
    "within its limits": "vminpu=0.8 vmaxpu=1.2",
    "above its limit": "vminpu=0.5 vmaxpu=0.75",
    "below its limit": "vminpu=1.2 vmaxpu=1.4",
    "far below its limit": "vminpu=1.4 vmaxpu=1.5 vlowpu=1.3",
}


def loads_of_all_models(limits: str) -> str:
    """A load of each model in this range of voltage; 6 and 7 jump at vlowpu in the engine, and not here."""
    models = [model for model in MODELS if model not in (6, 7) or not limits.startswith("far")]
    return "\n".join(
        f"New Load.l{model} bus1=c phases=3 conn=wye kv=0.48 kw=19 kvar=8 {MODELS[model]} {RANGES[limits]}"
        for model in models
    )


def loads_of_all_connections(model: int) -> str:
    return "\n".join(
        f"New Load.l{k} {connection} kw=15 kvar=5 {MODELS[model]} vminpu=0.8 vmaxpu=1.2"
        for k, connection in enumerate(CONNECTIONS.values())
    )


LOAD_SCRIPTS = {
    **{f"loads {limits}": loads_of_all_models(limits) for limits in RANGES},
    **{f"connections, model {model}": loads_of_all_connections(model) for model in (1, 5, 6, 8)},
}

OTHER_LOADS = {
    "at a neutral node": """New Reactor.ground bus1=c.4 bus2=c.0 phases=1 r=0.05 x=0.02
New Load.l bus1=c.1.2.3.4 phases=3 kv=0.48 kw=120 kvar=20 vminpu=0.7
New Load.one bus1=c.1.4 phases=1 kv=0.277 kw=50 kvar=5 model=5 vminpu=0.7""",
    "of negative power, and of reactive power alone": """New Load.l bus1=c phases=3 kv=0.48 kw=-90 kvar=30
New Load.z bus1=c.1 phases=1 kv=0.277 kw=20 pf=-0.9 model=2
New Load.q bus1=c phases=3 kv=0.48 kw=0 kvar=60""",
    "as impedances": "New Load.l bus1=c phases=3 kv=0.48 kw=150 kvar=60 model=1\nSet LoadModel=Admittance",
    "multiplied, but for fixed and exempt ones": "\n".join(
        f"New Load.l{k} bus1=c phases=3 kv=0.48 kw=50 kvar=20 status={status} vminpu=0.8"
        for k, status in enumerate(("variable", "fixed", "exempt", "variable model=6", "variable model=7"))
    )
    + "\nSet LoadMult=0.4",
    "of the fifth year": "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=30\nSet %growth=3\nSet year=5",
    "over several lines, with comments": """/* a comment
New Load.not bus1=c kw=999 */
New Load.l bus1=c ! phases=1
more phases=3 // kv=99
m kv=0.48 kw=90
~ kvar=30
Load.l.vminpu=0.8
Edit Load.l kw=100""",
}

UNEVEN = "New Load.uneven bus1=c.1.2 phases=1 kv=0.48 kw=60 kvar=10 vminpu=0.5"
"""A load that makes the voltages unequal."""

GENERATION = {
    "generator": "New Generator.g bus1=c kv=0.48 kw=50 kvar=10",
    "one phase": "New Generator.g bus1=c.1 phases=1 kv=0.277 kw=20 pf=0.9",
    "two phases": "New Generator.g bus1=c.2.3 phases=2 kv=0.48 kw=30 pf=0.9",
    "delta": "New Generator.g bus1=c conn=delta kv=0.48 kw=50 pf=-0.9",
    "below its limits": "New Generator.g bus1=c kv=0.48 kw=50 pf=-0.9 vminpu=1.1 vmaxpu=1.2",
    "partly above its limits": "New Generator.g bus1=c kv=0.48 kw=50 vminpu=0.7 vmaxpu=0.99",
    "impedance": "New Generator.g bus1=c kv=0.48 kw=50 model=2",
    "voltage-controlled": "New Generator.g bus1=c kv=0.48 kw=50 model=3 maxkvar=40 minkvar=-40 vpu=1.0",
    "photovoltaic": "New PVSystem.p bus1=c.1.2 phases=1 kv=0.48 kva=50 pmpp=40 irradiance=0.8",
    "volt-var": (
        "New PVSystem.p bus1=c kv=0.48 kva=50 pmpp=40\n"
        "New XYcurve.vv npts=4 Yarray=(1 1 -1 -1) XArray=(0.5 0.95 1.05 1.5)\n"
        "New InvControl.i mode=voltvar voltage_curvex_ref=rated vvc_curve1=vv derlist=(pvsystem.p)"
    ),
    "discharging": "New Storage.s bus1=c kv=0.48 kwrated=50 kwhrated=100 state=discharging",
    "charging": "New Storage.s bus1=c kv=0.48 kwrated=50 kwhrated=100 state=charging %stored=20",
}

FAR_LOAD = "New Load.d bus1=d.2 phases=1 kv=0.277 kw=50 kvar=10"
SCRIPTS = {
    **{f"transformer, {what}": (LINE, script) for what, script in TRANSFORMERS.items()},
    **{what: (LINE, STEP_DOWN, LOADS, script) for what, script in ELEMENTS.items()},
    **{f"line, {what}": (LINE, STEP_DOWN, LOADS, script, FAR_LOAD) for what, script in LINES.items()},
    **{what: (LINE, STEP_DOWN, script) for what, script in LOAD_SCRIPTS.items()},
    **{f"loads {what}": (LINE, STEP_DOWN, script) for what, script in OTHER_LOADS.items()},
    **{f"generation, {what}": (LINE, STEP_DOWN, UNEVEN, script) for what, script in GENERATION.items()},
}
"""Parts of a script for each thing that is compared with the engine."""
