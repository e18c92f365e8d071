"""Run `ripple-sim info`, and send this process SIGHUP as it begins to import the program."""

import importlib
import signal
import sys


class HangUp:
    """A finder of modules that sends the signal, and finds nothing."""

    def find_spec(self, name: str, *_: object) -> None:
        if name == "ripple_sim.cli.main":
            signal.raise_signal(signal.SIGHUP)


sys.meta_path.insert(0, HangUp())
sys.argv = ["ripple-sim", "info"]
importlib.import_module("ripple_sim.__main__")
