"""Meet SIGTERM, and SIGINT while that is cleaned up; print "cleaned up" if it comes to that."""

import signal

from ripple_sim.cli import signals

signals.end_in_good_order()
try:
    signal.raise_signal(signal.SIGTERM)
finally:
    signal.raise_signal(signal.SIGINT)
    print("cleaned up")
