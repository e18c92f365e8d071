"""The exact mode of a layer, which the plots compare with as well."""

import runpy
from pathlib import Path

_FILE = Path(__file__).parents[2] / "examples" / "plots" / "layer_mode.py"
lowest_square = runpy.run_path(str(_FILE))["lowest_square"]
