"""A scene rendered to a video: simulation, drawing and encoding, all three at the same time."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

import mujoco

from ripple_sim.capture.viewpoint import with_exposure
from ripple_sim.encode import FrameWriter, check_output, open_writer
from ripple_sim.errors import SceneError
from ripple_sim.overlay.comparison import compared_operators
from ripple_sim.scene.overlays import parse_request
from ripple_sim.scene.scene import MAX_DURATION, Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver.backends.backend import auto_backend
from ripple_sim.solver.gl import shared_context

from .film import Film, Shot
from .prefetch import Ahead
from .provenance import provenance

# Snapshots that wait to be drawn. One would do if all frames took the same time.
_WAITING = 2

# The simulation's state is fingerprinted every so many frames, to be compared when a job is resumed.
_CHECKED = 16

MAX_SLOW_MOTION = 1000

Progress = Callable[[int, int], None]


@dataclasses.dataclass(frozen=True)
class Summary:
    """What a rendered video took.

    `frames` is how many it has, of which those before `resumed_at` were there already. `renderer` is the driver's
    GL_RENDERER, `backend` the wave solver's. Times in seconds; the stages overlap, so they add up to more than
    `wall_seconds`.
    """

    output: Path
    frames: int
    resumed_at: int
    renderer: str
    backend: str
    substeps_per_frame: float
    setup_seconds: float
    physics_seconds: float
    wave_seconds: float
    render_seconds: float
    encode_seconds: float
    wall_seconds: float


def render_video(
    scene: Scene,
    output: str | Path,
    *,
    size: tuple[int, int] = (1280, 720),
    fps: int = 60,
    duration: float | None = None,
    slow_motion: float = 1.0,
    supersample: int = 1,
    shutter: float | None = None,
    aperture: float | None = None,
    focus: float | str | tuple[float, float, float] | None = None,
    exposures: int | None = None,
    transparent: bool = False,
    frame_format: str = "png",
    overlay: Sequence[str] | None = None,
    compare: str | None = None,
    resolution: int | None = None,
    backend: str = "auto",
    resume: bool = False,
    progress: Progress | None = None,
    on_step: Callable[[Simulation], None] | None = None,
) -> Summary:
    """Simulate a scene and write its video.

    The same scene and options give the same video on the same machine, bit for bit. While it is made, what is done is
    in a folder beside it, `output` with `.part` behind, and stays there if the job is interrupted.

    Parameters
    ----------
    scene : Scene
    output : path
        .mp4, .webm, .gif, .webp, or a folder for frames. It appears when it is whole.
    size : (width, height)
        [pixels].
    fps : int
        Frames a second.
    duration : float, optional
        Of the scene's time [s], instead of the scene's own.
    slow_motion : float
        Seconds of video for a second of the scene.
    supersample : int
        Frames are drawn so many times as wide and high, and averaged.
    shutter : float, optional
        Shutter angle [degrees], for motion blur: 360 leaves the shutter open from one frame to the next, 180 half of
        that time. This and the next three are used instead of what the scene's camera says.
    aperture : float, optional
        Diameter of the lens [m], for depth of field.
    focus : float, str or (x, y, z), optional
        What is sharp: a distance along the camera's axis [m], a body or a geom, or a point in the world [m].
    exposures : int, optional
        A frame is the mean of so many, each at its own moment and through its own point of the lens.
    transparent : bool
        Leave the background out, for .webp and a folder of frames.
    frame_format : str
        Of a folder's frames: "png", or "exr" for linear light before tone mapping, in half floats, without overlays
        (needs the package OpenEXR).
    overlay : sequence of str, optional
        What is drawn over the picture, instead of what the scene says; see `parse_request`.
    compare : str, optional
        Show a second run of the scene beside the first, with this baseline as wave operator; see `WaveSolver`.
    resolution, backend, on_step
        As for `Simulation`. While waves are computed on the CPU, `on_step` is called in a thread of its own.
    resume : bool
        Carry on where an interrupted job of the same scene and options has stopped; from the beginning if there is
        none. The simulation is run again up to there, and checked to be the same, the frames are not drawn again.
    progress : callable, optional
        Called with (frames done, frames in all) after each frame.

    Raises
    ------
    RippleError
        Before anything is simulated where the output, size, rate, scene or the job to resume is invalid; later if the
        physics becomes unstable or the video cannot be written on.
    """
    start = time.perf_counter()
    # MuJoCo would write its warnings to a file in the current folder; `Simulation` reports those that matter
    mujoco.set_mju_user_warning(lambda message: None)
    output, (width, height) = Path(output), size
    overlay, operators = scene.overlay if overlay is None else overlay, compared_operators(compare)
    request = parse_request(overlay)
    overlaid = bool(overlay) or len(operators) > 1
    check_output(output, width, height, fps, transparent=transparent, frame_format=frame_format, overlaid=overlaid)
    scene = with_exposure(scene, shutter=shutter, aperture=aperture, focus=focus, exposures=exposures)
    linear = frame_format == "exr"
    count = _frame_count(scene.duration if duration is None else duration, fps, slow_motion)
    gl = shared_context()
    job = {
        "the size": f"{width}x{height}",
        "the frame rate": fps,
        "the number of frames": count,
        "the slow motion": slow_motion,
        "the supersampling": supersample,
        "the camera's shutter": scene.camera.shutter,
        "the camera's aperture": scene.camera.aperture,
        "the camera's focus": str(scene.camera.focus or "what the camera looks at"),
        "the camera's exposures": scene.camera.exposures,
        "transparency": transparent,
        "the frame format": frame_format,
        "the overlays": ",".join(overlay),
        "the operators": ",".join(operators),
        "the resolution": resolution or "the scene's",
        "the wave solver": auto_backend() if backend == "auto" else backend,
        **provenance(scene, gl),
        **({"the version of OpenEXR": version("OpenEXR")} if linear else {}),
    }
    # software draws on the processor, which has enough to do with one frame
    ahead = 0 if gl.software else 1
    with open_writer(
        output,
        width=width,
        height=height,
        fps=fps,
        transparent=transparent,
        frame_format=frame_format,
        job=job,
        resume=resume,
    ) as writer:
        resumed_at = writer.frames
        rate = fps * slow_motion
        simulations = [
            Simulation(scene, fps=rate, resolution=resolution, backend=backend, operator=operator, on_step=on_step)
            for operator in operators
        ]
        film = Film(
            simulations,
            request,
            width=width,
            height=height,
            frames=count,
            rate=rate,
            operators=operators,
            supersample=supersample,
            transparent=transparent,
            linear=linear,
            gl=gl,
        )
        states = film.states(alive=_WAITING + ahead + 2)
        # waves on the GPU share the renderer's OpenGL context, which belongs to one thread at a time
        with Ahead(states, _WAITING) if simulations[0].backend == "cpu" else contextlib.nullcontext(states) as states:
            film.prepare()
            ready = time.perf_counter()
            for frame in film.draw_all(_missing(states, writer, progress, count), ahead):
                writer.write(frame)
                if progress is not None:
                    progress(writer.frames, count)
    return Summary(
        output=output,
        frames=count,
        resumed_at=resumed_at,
        renderer=gl.renderer,
        backend=simulations[0].backend,
        substeps_per_frame=sum(simulation.substeps_taken for simulation in simulations) / max(count - 1, 1),
        setup_seconds=ready - start,
        physics_seconds=sum(simulation.physics_seconds for simulation in simulations),
        wave_seconds=sum(simulation.wave_seconds for simulation in simulations),
        render_seconds=film.seconds,
        encode_seconds=writer.encode_seconds,
        wall_seconds=time.perf_counter() - start,
    )


def _missing(states: Iterable[Shot], writer: FrameWriter, progress: Progress | None, count: int) -> Iterator[Shot]:
    """Check the states, and pass over those whose frames were there before."""
    resumed_at = writer.frames
    for state in states:
        if state.exposure == 0 and state.number % _CHECKED == 0:
            writer.check_state(state.number, state.digest())
        if state.number >= resumed_at:
            yield state
        elif progress is not None and state.exposure == 0:
            progress(state.number + 1, count)


def _frame_count(duration: float, fps: int, slow_motion: float) -> int:
    """Frames of a scene of a duration [s]."""
    if not 0 < duration < MAX_DURATION:
        raise SceneError(f"duration is {duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    if not 0 < slow_motion <= MAX_SLOW_MOTION:
        raise SceneError(f"slow motion is {slow_motion!r}; valid is a positive number up to {MAX_SLOW_MOTION}")
    return max(1, round(duration * fps * slow_motion))
