"""A federate of somebody else that does one thing wrong at t = 0.1 s: ``BROKER WHAT [NAME FIRST LAST]``.

It imports helics alone. Its inverters, nine if it is not told which, show the same all the time.
"""

import sys
import threading

STEP, WRONG, END = 0.01, 0.1, 0.2  # s
SHOWN = {"f": 60.0, "P": 300e3, "Q": 10e3, "V": 2400.0}


def main(broker: str, what: str, name: str = "strange", first: str = "1", last: str = "9") -> None:
    """Publish until the end, or until something is wrong, for some of the inverters."""
    import helics as h

    info = h.helicsCreateFederateInfo()
    h.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
    h.helicsFederateInfoSetCoreInitString(info, f"--federates=1 --broker_address={broker} --loglevel=no_print")
    h.helicsFederateInfoSetFlagOption(info, h.HELICS_FLAG_UNINTERRUPTIBLE, True)
    me = h.helicsCreateValueFederate(name, info)
    kind = h.HELICS_DATA_TYPE_DOUBLE
    out = {
        (i, x): h.helicsFederateRegisterGlobalPublication(me, f"grid/inv{i}/{x}", kind, "")
        for i in range(int(first), int(last) + 1)
        for x in SHOWN
    }
    h.helicsFederateRegisterSubscription(me, "grid/inv1/P_set", "W")  # so that its time waits for the controller's
    if what == "not beginning":
        threading.Event().wait()
    h.helicsFederateEnterExecutingMode(me)
    for k in range(round(END / STEP) + 1):
        wrong = k * STEP >= WRONG
        if wrong and what == "leaves":
            break
        if wrong and what == "hangs":
            threading.Event().wait()
        if wrong and what == "error":
            h.helicsFederateGlobalError(me, 7, "no solution of my power flow")
            break
        for (_, x), topic in out.items():
            h.helicsPublicationPublishDouble(topic, SHOWN[x])
        if k < round(END / STEP):
            h.helicsFederateRequestTime(me, (k + 1) * STEP)
    h.helicsFederateDisconnect(me)


if __name__ == "__main__":
    main(*sys.argv[1:])
