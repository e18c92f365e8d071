"""From the words of a command line to a command.

A command is a class: its fields are the arguments, the docstrings the help, and `run` does the work. Heavy imports are
inside `run`, so that `--help` and usage errors are answered at once. `view` and the commands that write no file are
here: `bench`, `cache`, `completion`, `info` and `materials`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json as json_format
import math
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro.conf
import tyro.extras
from tyro.conf import Positional, arg

from .arguments import Count, Seed, Size, UpAxis
from .atlas import AtlasCommand
from .batch import BatchCommand
from .render import DropCommand, ExportCommand, RenderCommand

if TYPE_CHECKING:
    from ripple_sim.viewer.window import Window


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


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewCommand:
    """Open a scene or a mesh in an interactive window.

    Click: poke the surface. Drag: orbit; with shift: pan; wheel: zoom. Space: pause or resume. N: next frame. R: reset.
    T: throw a ball at the pointer. O: next operator (fem, uncorrected, paper). C: heatmap on or off. S: screenshot.
    V: start or stop a recording. H: list of keys. Q: quit. Sliders set the poke's impulse and the material.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE|MESH")]
    """Name of a shipped scene, path of a scene file (TOML), or a mesh (OBJ, OFF, PLY, STL, GLB ...)."""
    size: Size = (800, 600)
    """Window size in pixels."""
    resolution: Count = 64
    """Texels along the edge of a chart; more resolve finer waves and take longer."""
    bodies: Seed = 3
    """Number of bodies that fall on a mesh; 0 for none."""
    seed: Seed = 0
    """Seed for the bodies' places and sizes."""
    up: UpAxis = None
    """Axis of the mesh that points up; a flat sheet lies down."""
    repair: bool = False
    """Close the mesh's holes (needs the package pymeshfix)."""
    wrap: bool = False
    """Take a closed surface round the mesh: for parts that pass through each other, or scans in pieces."""
    folder: Annotated[Path, arg(metavar="FOLDER")] = Path()
    """Folder for screenshots and videos."""
    web: bool = False
    """Serve a web page to a browser on this machine instead of a window (needs the extra ripple-sim[web])."""
    port: Count = 8080
    """Port of the web page."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address of the web page; any other than this machine's own lets other machines see and drive the viewer."""
    benchmark: bool = False
    """Measure the window's update rate, print it, and exit."""

    def run(self) -> None:
        """Show the scene until the user quits."""
        from ripple_sim.encode.output import check_size
        from ripple_sim.scene.drop import is_scene
        from ripple_sim.viewer.window import check_display, display_problem

        # refuse what cannot work before anything that takes time: first what is asked for, then what this machine lacks
        is_scene(self.scene)
        check_size(*self.size)
        if self.benchmark:
            from ripple_sim.viewer.window import benchmark

            print(benchmark(self._window(off_screen=display_problem() is not None)))
        elif self.web:
            from ripple_sim.viewer.web import check_web, serve

            check_web(self.port, self.host)
            serve(self._window(off_screen=True), self.port, self.host)
        else:
            from ripple_sim.viewer.window import run

            check_display()
            run(self._window(off_screen=False))

    def _window(self, off_screen: bool) -> Window:
        from ripple_sim.viewer.opening import open_scene
        from ripple_sim.viewer.session import Session

        scene = open_scene(
            self.scene, bodies=self.bodies, seed=self.seed, up=self.up, repair=self.repair, wrap=self.wrap
        )
        session = Session(scene, resolution=self.resolution)

        from ripple_sim.viewer.window import Window

        return Window(session, size=self.size, off_screen=off_screen, folder=self.folder)


COMMANDS: dict[str, Callable[..., Any]] = {
    "render": RenderCommand,
    "drop": DropCommand,
    "export": ExportCommand,
    "batch": BatchCommand,
    "atlas": AtlasCommand,
    "info": InfoCommand,
    "bench": BenchCommand,
    "view": ViewCommand,
    "materials": MaterialsCommand,
    "cache": CacheCommand,
    "completion": CompletionCommand,
}

_DESCRIPTION = "Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation."


class UsageError(Exception):
    """The command line is invalid; the message says where, and names the help."""


def parse(argv: Sequence[str]) -> Any:
    """Return the command to run, or None if the help or a completion script was printed instead.

    Raises
    ------
    UsageError
    """
    command = _parse(argv)
    if isinstance(command, CompletionCommand):  # which tyro makes from all the commands
        command = _parse(["--tyro-print-completion", command.shell])
    return command


def _parse(argv: Sequence[str]) -> Any:
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="ripple-sim",
                description=_DESCRIPTION,
                args=list(argv),
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as ending:
        if ending.code:
            command = f" {argv[0]}" if argv and argv[0] in COMMANDS else ""
            raise UsageError(f"{_first_part(complaint.getvalue())}; see ripple-sim{command} --help") from None
        return None


def _first_part(box: str) -> str:
    """Reduce tyro's complaint to the text between its first two rules, without the help texts (indented by 8).

    A complaint is a title, a rule, what is wrong, a rule, and hints; it is framed where stdout is UTF-8.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", box)
    parts = re.split(r"^[│╭╰ ]*(?:─ .* ─+|─{3,}|-{3,})[│╮╯ ]*$", text, flags=re.MULTILINE)
    part = parts[1] if len(parts) > 1 else text
    said = [line.strip("│ ") for line in part.splitlines() if not re.match(r"│? {9}", line)]
    return " ".join(said).strip().rstrip(".")
