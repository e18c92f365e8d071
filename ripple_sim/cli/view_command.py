"""`ripple-sim view`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from .arguments import Count, Seed, Size, UpAxis

if TYPE_CHECKING:
    from ripple_sim.viewer.window import Window


@dataclasses.dataclass(frozen=True, kw_only=True)
class View:
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
        from ripple_sim.scene.find_scene import is_scene
        from ripple_sim.viewer.display import check_display, display_problem

        # refuse what cannot work before anything that takes time: first what is asked for, then what this machine lacks
        is_scene(self.scene)
        check_size(*self.size)
        if self.benchmark:
            from ripple_sim.viewer.desktop import benchmark

            print(benchmark(self._window(off_screen=display_problem() is not None)))
        elif self.web:
            from ripple_sim.viewer.web import check_web, serve

            check_web(self.port, self.host)
            serve(self._window(off_screen=True), self.port, self.host)
        else:
            from ripple_sim.viewer.desktop import run

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
