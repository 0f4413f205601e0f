"""A grid of somebody else, as a HELICS federate: it imports nothing of gridpeers, which controls its inverters.

Nine inverters share one bus by droop. The substation carries what they do not, until it is lost at 1 s; at 4 s the
load drops. Start a broker (helics_broker -f 2), this, and: gridpeers run examples/helics_islanding.toml --plant helics
"""

import sys

import helics

BROKER = sys.argv[1] if len(sys.argv) > 1 else "tcp://127.0.0.1:23404"
END, STEP, ISLANDED, DROPPED = 7.0, 0.01, 1.0, 4.0  # s
S = {f"inv{i}": 600e3 if i in (1, 4, 7) else 350e3 for i in range(1, 10)}  # VA
M_P, M_Q, F_NOM, V_NOM = 0.01, 0.05, 60.0, 2401.8  # droops in pu, Hz, V
SENSORS = (("f", "Hz"), ("P", "W"), ("Q", "var"), ("V", "V"))

info = helics.helicsCreateFederateInfo()
helics.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
helics.helicsFederateInfoSetCoreInitString(info, f"--federates=1 --broker_address={BROKER}")
helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
fed = helics.helicsCreateValueFederate("somebody", info)
double = helics.HELICS_DATA_TYPE_DOUBLE
sensors = {
    name: [helics.helicsFederateRegisterGlobalPublication(fed, f"grid/{name}/{x}", double, u) for x, u in SENSORS]
    for name in S
}
P_sets = {name: helics.helicsFederateRegisterSubscription(fed, f"grid/{name}/P_set", "W") for name in S}
V_sets = {name: helics.helicsFederateRegisterSubscription(fed, f"grid/{name}/V_set", "V") for name in S}
fed_by_grid = {
    name: helics.helicsFederateRegisterGlobalPublication(
        fed, f"grid/{name}/grid_connected", helics.HELICS_DATA_TYPE_BOOLEAN, ""
    )
    for name in S
}
for name in S:  # until the first set-points come
    helics.helicsInputSetDefaultDouble(P_sets[name], 0.647 * S[name])
    helics.helicsInputSetDefaultDouble(V_sets[name], V_NOM * (1.0 + 0.001 * S[name] / 350e3))


def publish(t: float) -> None:
    """Solve the droops with the set-points of now, and publish what the sensors show at t."""
    P = {name: helics.helicsInputGetDouble(topic) for name, topic in P_sets.items()}
    V = {name: helics.helicsInputGetDouble(topic) / V_NOM for name, topic in V_sets.items()}
    load = 2.4e6 if t < DROPPED else 2.0e6
    surplus = (sum(P.values()) - load) / sum(S.values()) if t > ISLANDED else 0.0  # pu
    V_bus = sum(V.values()) / len(V)
    for name, rating in S.items():
        values = (
            F_NOM * (1.0 + M_P * surplus),
            P[name] - surplus * rating,
            (V[name] - V_bus) / M_Q * rating,
            V_bus * V_NOM,
        )
        for topic, value in zip(sensors[name], values, strict=True):
            helics.helicsPublicationPublishDouble(topic, value)
        helics.helicsPublicationPublishBoolean(fed_by_grid[name], int(t <= ISLANDED))


helics.helicsFederateEnterExecutingMode(fed)
publish(0.0)
for k in range(1, round(END / STEP) + 1):
    helics.helicsFederateRequestTime(fed, k * STEP)
    publish(k * STEP)
helics.helicsFederateDisconnect(fed)
