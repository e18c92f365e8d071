"""Meet a signal while `signal_on_import` is imported; print what happens in which order."""

import importlib
import time

from ripple_sim.cli import signals

signals.end_in_good_order()
try:
    importlib.import_module("signal_on_import")
    for _ in range(500):  # 5 s at most: the exception comes from a timer
        time.sleep(0.01)
finally:
    print("cleaned up")
