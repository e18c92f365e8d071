"""`python -m ripple_sim`, the same as the `ripple-sim` command."""

import sys

from ripple_sim.cli.start import main

sys.exit(main())
