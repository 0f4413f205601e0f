"""``python -m netem.relay tcp/127.0.0.1:7500 tcp/127.0.0.1:7447 --delay 0.1``: a relay from the command line."""

from __future__ import annotations

import argparse
import signal
import sys

from netem.relay import EndpointError, Faults, FaultsError, Relay, RelayCommandError, RelayError
from netem.relay.relay_command import FAULTS, HELP
from wire.driver.output import speaking
from wire.schema.table_schema import fields_of

OK, USAGE = 0, 2


def main(arguments: list[str]) -> int:
    """Relay until the command "end", Ctrl-C or SIGTERM; return exit status 2 if that is impossible."""
    options = _parser().parse_args(arguments)
    given = {name: getattr(options, name) for name in FAULTS}
    returning = {name: value for name in FAULTS if (value := getattr(options, f"back_{name}")) is not None}
    try:
        there, back = Faults(**given), Faults(**{**given, **returning})
        relay = Relay(options.listen, options.connect, there=there, back=back, seed=options.seed)
    except (EndpointError, FaultsError, RelayError) as error:
        sys.stderr.write(f"{error}\n")
        return USAGE
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends it as Ctrl-C does
    try:
        with relay:
            print(relay.do("show"), flush=True)
            for line in sys.stdin:
                print(_answer(relay, line), flush=True)
                if line.strip() == "end":
                    return OK
            while True:  # no more lines, as in the background: go on until a signal ends it
                signal.pause()
    except KeyboardInterrupt:
        return OK


def _answer(relay: Relay, line: str) -> str:
    try:
        return relay.do(line)
    except (RelayCommandError, FaultsError) as error:
        return "refused: " + "; ".join(str(error).splitlines())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m netem.relay",
        description="Relay Zenoh's traffic between two endpoints, and delay and lose it on the way.",
        epilog="Lines on standard input change it while it runs; each is answered by one line:\n\n" + HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("listen", help="where peers connect to, e.g. tcp/127.0.0.1:7500; port 0 for any free one")
    parser.add_argument("connect", help="where it goes on to, e.g. tcp/127.0.0.1:7447")
    for field in fields_of(Faults):
        metavar, default = field.unit or "P", field.default
        text = f"both ways (default {default:g})"
        parser.add_argument(f"--{field.name}", type=float, default=default, metavar=metavar, help=text)
        parser.add_argument(f"--back-{field.name}", type=float, metavar=metavar, help="only from the target back")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default 0)")
    return parser


if __name__ == "__main__":
    with speaking("netem.relay"):
        sys.exit(main(sys.argv[1:]))
