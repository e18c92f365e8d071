"""Entry point of `ripple-sim` and of `python -m ripple_sim`.

Signals are set up before anything else is imported.
"""

import atexit
import sys

from ripple_sim.cli.signals import end_at_once, finish_undisturbed

end_at_once()
atexit.register(finish_undisturbed)  # the first, so that it is called after all others

from ripple_sim.cli.main import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
