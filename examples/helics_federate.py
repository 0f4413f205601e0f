"""A foreign grid as a HELICS federate, which imports nothing of gridpeers; agents of gridpeers control its inverters.

Nine inverters share one bus by droop. The substation fails at 1 s, and the load falls at 4 s.
docs/how-to/cosimulation.md shows how to run it.
"""

import sys

import helics as h

BROKER = sys.argv[1] if len(sys.argv) > 1 else "tcp://127.0.0.1:23404"
END = float(sys.argv[2]) if len(sys.argv) > 2 else 7.0  # s
STEP, ISLANDED, FALLS = 0.01, 1.0, 4.0  # s
RATING = {f"inv{i}": 600e3 if i in (1, 4, 7) else 350e3 for i in range(1, 10)}  # VA
M_P, M_Q, F_NOM, V_NOM = 0.01, 0.05, 60.0, 2401.8  # droops in pu, Hz, V

info = h.helicsCreateFederateInfo()
h.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
h.helicsFederateInfoSetCoreInitString(info, f"--federates=1 --broker_address={BROKER}")
h.helicsFederateInfoSetFlagOption(info, h.HELICS_FLAG_UNINTERRUPTIBLE, True)  # set-points must not wake it early
me = h.helicsCreateValueFederate("their-grid", info)
out, in_ = {}, {}
for name, rating in RATING.items():
    for what, unit in {"f": "Hz", "P": "W", "Q": "var", "V": "V"}.items():
        key = f"grid/{name}/{what}"
        out[name, what] = h.helicsFederateRegisterGlobalPublication(me, key, h.HELICS_DATA_TYPE_DOUBLE, unit)
    key = f"grid/{name}/grid_connected"
    out[name, "fed"] = h.helicsFederateRegisterGlobalPublication(me, key, h.HELICS_DATA_TYPE_BOOLEAN, "")
    for what, unit, first in (("P_set", "W", 0.647 * rating), ("V_set", "V", V_NOM)):
        in_[name, what] = h.helicsFederateRegisterSubscription(me, f"grid/{name}/{what}", unit)
        h.helicsInputSetDefaultDouble(in_[name, what], first)


def solve_and_publish(t: float) -> None:
    """Find the common frequency and voltage for the present set-points, and publish the sensors at t."""
    got = {key: h.helicsInputGetDouble(topic) for key, topic in in_.items()}
    load = 2.0e6 if t > FALLS else 2.4e6
    surplus = (sum(got[n, "P_set"] for n in RATING) - load) / sum(RATING.values()) if t > ISLANDED else 0.0  # pu
    V = sum(got[n, "V_set"] for n in RATING) / len(RATING)
    for n, rating in RATING.items():
        h.helicsPublicationPublishDouble(out[n, "f"], F_NOM * (1.0 + M_P * surplus))
        h.helicsPublicationPublishDouble(out[n, "P"], got[n, "P_set"] - surplus * rating)
        h.helicsPublicationPublishDouble(out[n, "Q"], (got[n, "V_set"] - V) / V_NOM / M_Q * rating)
        h.helicsPublicationPublishDouble(out[n, "V"], V)
        h.helicsPublicationPublishBoolean(out[n, "fed"], int(t <= ISLANDED))


h.helicsFederateEnterExecutingMode(me)
solve_and_publish(0.0)
for k in range(1, round(END / STEP) + 1):
    h.helicsFederateRequestTime(me, k * STEP)
    solve_and_publish(k * STEP)
h.helicsFederateDisconnect(me)
