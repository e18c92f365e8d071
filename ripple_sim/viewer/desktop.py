"""The viewer on the desktop: the window's loop, and its speed."""

from __future__ import annotations

import dataclasses
import time

from .window import Window


def run(window: Window) -> None:
    """Show a window until the user closes it, at most in real time."""
    window.open()
    frame = 1 / window.session.fps
    due = time.perf_counter()
    try:
        while not window.closed:
            window.plotter.iren.process_events()
            window.tick()
            due = max(due + frame, time.perf_counter() - frame)
            time.sleep(max(0.0, due - time.perf_counter()))
    finally:
        window.close()


@dataclasses.dataclass(frozen=True)
class Benchmark:
    """Highest update rate of a window, and where the time goes.

    Attributes
    ----------
    updates_per_second : float
    simulate, draw : float
        [ms] per update, for physics, waves and the displaced mesh; for VTK.
    processor : float
        Processor time of all threads [ms] per update, which other programs hardly change.
    renderer : str
        OpenGL driver.
    """

    updates_per_second: float
    simulate: float
    draw: float
    processor: float
    renderer: str

    def __str__(self) -> str:
        return (
            f"{self.updates_per_second:.1f} updates/s: simulation {self.simulate:.1f} ms, drawing {self.draw:.1f} ms; "
            f"{self.processor:.1f} ms of processor time ({self.renderer})"
        )


def benchmark(window: Window, updates: int = 60, tries: int = 3) -> Benchmark:
    """Best of several runs of some updates without waiting, each with a poke and a ball at the start."""
    window.open()
    width, height = window.plotter.render_window.GetSize()
    trials = []
    for _ in range(tries):
        window.actions.reset()
        window.actions.poke_at(width // 2, height // 2)
        window.actions.throw()
        start, processor, drawing = time.perf_counter(), time.process_time(), window.seconds_drawing
        for _ in range(updates):
            window.tick()
        trials.append(
            (
                time.perf_counter() - start,
                window.seconds_drawing - drawing,
                time.process_time() - processor,
            )
        )
    renderer = window.gl_renderer
    window.close()
    seconds, drawing, processor = min(trials)
    per_update = 1e3 / updates
    return Benchmark(
        updates_per_second=updates / seconds,
        simulate=(seconds - drawing) * per_update,
        draw=drawing * per_update,
        processor=processor * per_update,
        renderer=renderer,
    )
