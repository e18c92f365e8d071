"""Run `ripple-sim info`, which meets a signal while it imports `signal_on_import`.

python interrupt_info.py parsing: as the arguments are parsed; python interrupt_info.py running:
as the command runs.
"""

import importlib
import signal
import sys

from ripple_sim.cli import main as cli, reports


def meet_signal(_: object) -> None:
    importlib.import_module("signal_on_import")
    for _ in range(10**9):
        pass


# a job in the background ignores SIGINT
signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.argv[1] == "parsing":
    cli.parse = meet_signal
else:
    reports.InfoCommand.run = meet_signal
sys.exit(cli.main(["info"]))
