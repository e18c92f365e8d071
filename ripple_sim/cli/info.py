"""Commands that tell something and write no file: `bench`, `cache`, `completion`, `info` and `materials`."""

from __future__ import annotations

import dataclasses
import json as json_format
import math
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchCommand:
    """Measure the wave solver: speed beside the bound of memory, cost of the coupling, accuracy against theory."""

    meshes: Annotated[Positional[tuple[Path, ...]], arg(metavar="[MESH ...]", help_behavior_hint="(optional)")] = ()
    """Meshes of which to time the atlas and the wave step, in addition to the duck."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print; the stages are announced on stderr."""
        from ripple_sim.bench import as_text, measure

        report = measure(list(self.meshes), lambda stage: print(f"measuring {stage} ...", file=sys.stderr))
        print(json_format.dumps(report, indent=2) if self.json else as_text(report))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CacheCommand:
    """Show where atlases are kept, and how much room they take: at most RIPPLE_SIM_CACHE_LIMIT megabytes, or 500."""

    clear: bool = False
    """Remove them."""

    def run(self) -> None:
        """Clear the cache if asked to, and print what is in it."""
        from ripple_sim.solver.cache import cache_folder, cache_limit, cached_files, remove

        limit, files = cache_limit(), cached_files()
        if self.clear:
            freed = sum(remove(file) for file in files)
            print(f"removed {len(files)} files, {_megabytes(freed)} MB")
            files = cached_files()
        size = sum(file.size for file in files)
        print(f"{cache_folder()}: {len(files)} files, {_megabytes(size)} of {_megabytes(limit)} MB")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.0f}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class CompletionCommand:
    """Print a shell completion script. To use it: source <(ripple-sim completion bash)."""

    shell: Annotated[Positional[Literal["bash", "zsh"]], arg(metavar="SHELL")]
    """Shell to complete in: bash or zsh."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class InfoCommand:
    """Show versions, the OpenGL driver and the wave solver, and what to install if rendering is not possible."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.diagnostics import as_text, collect

        info = collect()
        print(json_format.dumps(dataclasses.asdict(info), indent=2) if self.json else as_text(info))


# Of the wave whose speed and decay are told [m].
_WAVELENGTH = 0.05


@dataclasses.dataclass(frozen=True, kw_only=True)
class MaterialsCommand:
    """List the real materials by name, with speed and decay of a wave of 5 cm, sources, and where they hold."""

    json: bool = False
    """Print them as JSON."""

    def run(self) -> None:
        """Print the table."""
        from ripple_sim.solver.operator.presets import PRESETS

        table = {name: _facts(name) for name in PRESETS}
        if self.json:
            print(json_format.dumps(table, indent=2))
            return
        width = max(map(len, table))
        for name, row in table.items():
            print(f"{name:{width}}  {row['speed [m/s]']:.3g} m/s, falls to 1/e in {row['decay [s]']:.3g} s")
            parameters = ", ".join(f"{key} {value:g}" for key, value in row["parameters"].items())
            print(f"{'':{width}}  {row['law']}: {parameters}")
            print(f"{'':{width}}  holds: {row['valid']}")
            print(f"{'':{width}}  source{'' if row['checked'] else ', not checked'}: {row['source']}")


def _facts(name: str) -> dict[str, Any]:
    from ripple_sim.solver import Material
    from ripple_sim.solver.operator.material import decay_time, phase_speed
    from ripple_sim.solver.operator.presets import PRESETS

    material, q = Material.preset(name), 2 * math.pi / _WAVELENGTH
    facts = {"speed [m/s]": phase_speed(material, q), "decay [s]": decay_time(material, q)}
    return facts | dataclasses.asdict(PRESETS[name])
