"""`ripple-sim info`."""

from __future__ import annotations

import dataclasses
import json as json_format


@dataclasses.dataclass(frozen=True, kw_only=True)
class Info:
    """Show versions, the OpenGL driver and the wave solver, and what to install if rendering is not possible."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.info import as_text, collect

        info = collect()
        print(json_format.dumps(dataclasses.asdict(info), indent=2) if self.json else as_text(info))
