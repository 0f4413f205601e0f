"""``python -m netem.tc eth0 --delay 0.1 --loss 0.02``: faults on a device, until Ctrl-C."""

from __future__ import annotations

import argparse
import signal
import sys

from netem.relay.faults import UNITS, Faults, FaultsError
from netem.tc import Impaired, TcError, netem_steps, steps_without_netem, why_no_netem
from wire.driver.output import speaking

OK, NO, USAGE = 0, 1, 2


def main(arguments: list[str]) -> int:
    """Set faults and hold them until Ctrl-C or SIGTERM; exit status 1 if the kernel cannot, 2 for a mistake."""
    parser = argparse.ArgumentParser(prog="python -m netem.tc", description="Faults on a network device, by tc.")
    parser.add_argument("device", nargs="?", help='e.g. eth0; without one: whether this kernel has "netem"')
    parser.add_argument("--namespace", default="", help="network namespace in which the device is")
    for name, unit in UNITS.items():
        default = getattr(Faults(), name)
        parser.add_argument(f"--{name}", type=float, default=default, metavar=unit.strip() or "P")
    options = parser.parse_args(arguments)
    missing = why_no_netem()
    print(missing or "this kernel has tc netem", flush=True)
    if options.device is None:
        return NO if missing else OK
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends it as Ctrl-C does
    try:
        faults = Faults(**{name: getattr(options, name) for name in UNITS})
        steps = (steps_without_netem if missing else netem_steps)(options.device, faults)
        with Impaired(options.device, steps, namespace=options.namespace):
            for step in steps:
                print(" ".join(step.do), flush=True)
            print(f"{options.device}: {faults}; until Ctrl-C", flush=True)
            while True:
                signal.pause()
    except KeyboardInterrupt:
        return OK
    except FaultsError as error:
        sys.stderr.write(f"{error}\n")
        return USAGE
    except TcError as error:
        sys.stderr.write(f"{error}\n")
        return NO


if __name__ == "__main__":
    with speaking("netem.tc"):
        sys.exit(main(sys.argv[1:]))
