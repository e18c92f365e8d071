"""`ripple-sim materials`."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

# Of the wave whose speed and decay are told [m].
_WAVELENGTH = 0.05


@dataclasses.dataclass(frozen=True, kw_only=True)
class Materials:
    """List the real materials by name, with speed and decay of a wave of 5 cm, sources, and where they hold."""

    json: bool = False
    """Print them as JSON."""

    def run(self) -> None:
        """Print the table."""
        from ripple_sim.solver.operator.presets import PRESETS

        table = {name: _told(name) for name in PRESETS}
        if self.json:
            print(json.dumps(table, indent=2))
            return
        width = max(map(len, table))
        for name, row in table.items():
            print(f"{name:{width}}  {row['speed [m/s]']:.3g} m/s, falls to 1/e in {row['decay [s]']:.3g} s")
            parameters = ", ".join(f"{key} {value:g}" for key, value in row["parameters"].items())
            print(f"{'':{width}}  {row['law']}: {parameters}")
            print(f"{'':{width}}  holds: {row['valid']}")
            print(f"{'':{width}}  source{'' if row['checked'] else ', not checked'}: {row['source']}")


def _told(name: str) -> dict[str, Any]:
    from ripple_sim.solver import Material
    from ripple_sim.solver.operator.material import decay_time, phase_speed
    from ripple_sim.solver.operator.presets import PRESETS

    material, q = Material.preset(name), 2 * math.pi / _WAVELENGTH
    told = {"speed [m/s]": phase_speed(material, q), "decay [s]": decay_time(material, q)}
    return told | dataclasses.asdict(PRESETS[name])
