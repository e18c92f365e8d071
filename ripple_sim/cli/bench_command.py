"""`ripple-sim bench`."""

from __future__ import annotations

import dataclasses
import json as json_format
import sys
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


@dataclasses.dataclass(frozen=True, kw_only=True)
class Bench:
    """Measure the wave solver: speed against rivals and the bound of memory, accuracy against exact solutions."""

    meshes: Annotated[Positional[tuple[Path, ...]], arg(metavar="[MESH ...]", help_behavior_hint="(optional)")] = ()
    """Meshes on which to measure arrival times, in addition to the built-in one."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print; the stages are announced on stderr."""
        from ripple_sim.bench.report import as_text, measure

        report = measure(list(self.meshes), lambda stage: print(f"measuring {stage} ...", file=sys.stderr))
        print(json_format.dumps(report, indent=2) if self.json else as_text(report))
