"""Shots of several runs, and the summary of a video."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from ripple_sim.capture.snapshot import Snapshot
from ripple_sim.cli.render import _summary_text
from ripple_sim.video.film import Shot
from ripple_sim.video.render_video import Summary, Times

MODEL = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><body><freejoint/><geom size="1"/></body></worldbody></mujoco>'
)


def snapshot(place: float = 0.0, height: float = 0.0, number: int = 7) -> Snapshot:
    data = mujoco.MjData(MODEL)
    data.qpos[0] = place
    return Snapshot(number, 2, data, {"egg": np.full((6, 4, 4), height, np.float32)}, {}, [])


def test_a_shot_is_known_by_the_state_of_every_run() -> None:
    shot = Shot((snapshot(), snapshot(place=1.0)), None)
    assert (shot.number, shot.exposure) == (7, 2)
    same = Shot((snapshot(number=8), snapshot(place=1.0)), None)
    assert shot.digest() == same.digest()
    others = [
        Shot((snapshot(place=1.0), snapshot()), None),
        Shot((snapshot(), snapshot(place=np.nextafter(1.0, 2))), None),
        Shot((snapshot(height=1e-30), snapshot(place=1.0)), None),
        Shot((snapshot(),), None),
    ]
    assert len({shot.digest(), *(other.digest() for other in others)}) == 1 + len(others)
    int(shot.digest(), 16)  # hexadecimal digits, as the record wants them


@pytest.mark.parametrize(("frames", "resumed_at"), [(1, 0), (11, 0), (11, 5)])
def test_a_summary_adds_up_the_runs(frames: int, resumed_at: int) -> None:
    runs = [
        SimpleNamespace(backend="cpu", substeps_taken=taken, physics_seconds=1.0, wave_seconds=2.0)
        for taken in (100, 300)
    ]
    writer = SimpleNamespace(path=Path("clip.mp4"), frames=frames, encode_seconds=0.5)
    gl = SimpleNamespace(renderer="llvmpipe")
    film = SimpleNamespace(simulations=runs, seconds=4.0)
    summary = Summary.of(
        film, writer, gl, resumed_at=resumed_at, started=Times(0.0, 10.0, 1.0), ready=Times(5.0, 13.0, 2.0)
    )
    assert summary.substeps_per_frame == (400 if frames == 1 else 40)
    assert (summary.setup_seconds, summary.physics_seconds, summary.wave_seconds) == (3.0, 2.0, 4.0)
    assert "compiling" not in _summary_text(dataclasses.replace(summary, compile_seconds=0.0))
    text = _summary_text(dataclasses.replace(summary, compile_seconds=7.0))
    assert "compiling (once) 7.0 s, set-up 3.0 s" in text
    assert text.startswith(f"clip.mp4: {frames} frames in ")
    assert ("the first 5 of them rendered before" in text) == (resumed_at > 0)
    assert "physics 2.0 s, waves 4.0 s, rendering 4.0 s, encoding 0.5 s" in text
