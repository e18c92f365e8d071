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
    """Open a window on a scene, or on any closed mesh, and play with it.

    Click: poke the surface. Drag: orbit; with shift: pan; wheel: zoom. Space: pause, go on. N: next frame. R: reset.
    T: throw a ball at the pointer. O: operator (fem, uncorrected, paper). C: height as colours. S: screenshot.
    V: record a video, stop. H: list of keys. Q: quit. Sliders set the poke's impulse and the material.
    """

    scene: Annotated[Positional[str], arg(metavar="SCENE|MESH")]
    """Name of a shipped scene, path of a scene file (TOML), or a closed mesh (OBJ, OFF, PLY, STL, GLB ...)."""
    size: Size = (800, 600)
    """Size of the window in pixels."""
    resolution: Count = 64
    """Texels along an edge of a cube face; more carry finer waves and take longer."""
    bodies: Seed = 3
    """How many bodies fall on a mesh; 0 for none."""
    seed: Seed = 0
    """Chooses where and what falls."""
    up: UpAxis = None
    """Axis of the mesh that points up."""
    repair: bool = False
    """Mend a mesh that is open or not manifold (needs the package pymeshfix)."""
    folder: Annotated[Path, arg(metavar="FOLDER")] = Path()
    """Where screenshots and videos go."""
    web: bool = False
    """Serve it to a browser on this machine in place of a window (needs the extra ripple-sim[web])."""
    port: Count = 8080
    """Port of the web page on 127.0.0.1."""
    benchmark: bool = False
    """Measure how many times a second the window can be updated, print that, and leave."""

    def run(self) -> None:
        """Show the scene until the user leaves."""
        from ripple_sim.viewer.display import check_display, display_problem

        # what cannot work is told before anything that takes time
        if self.benchmark:
            from ripple_sim.viewer.desktop import benchmark

            print(benchmark(self._window(off_screen=display_problem() is not None)))
        elif self.web:
            from ripple_sim.viewer.web import check_web, serve

            check_web(self.port)
            serve(self._window(off_screen=True), self.port)
        else:
            from ripple_sim.viewer.desktop import run

            check_display()
            run(self._window(off_screen=False))

    def _window(self, off_screen: bool) -> Window:
        from ripple_sim.viewer.opening import open_scene
        from ripple_sim.viewer.session import Session

        scene = open_scene(self.scene, bodies=self.bodies, seed=self.seed, up=self.up, repair=self.repair)
        session = Session(scene, resolution=self.resolution)

        from ripple_sim.viewer.window import Window

        return Window(session, size=self.size, off_screen=off_screen, folder=self.folder)
