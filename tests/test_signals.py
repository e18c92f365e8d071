"""Sensors of scene files: checked, exported, stored by batches, drawn."""

import csv
import re
import wave
from pathlib import Path

import numpy as np
import pytest
from scene_files import write_scene

from ripple_sim import (
    ExportOptions,
    Simulation,
    VideoOptions,
    export_scene,
    load_scene,
    render_video,
)
from ripple_sim.batch.worker import FrameRecord, StoreEntry
from ripple_sim.encode.replace import MARK
from ripple_sim.errors import SceneError
from ripple_sim.overlay.notes import traces

MODEL = """<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
<geom name="ball" type="sphere" size="0.3" pos="0 0 0.3"/><site name="top" pos="0 0 0.6"/>
<body pos="0.05 0 0.65"><freejoint/><geom size="0.05" mass="0.3"/></body></worldbody></mujoco>"""
SCENE = """
model = "scene.xml"
duration = 0.5
[[ripple]]
geom = "ball"
resolution = 16
material = { speed = 5.0, damping = 3.0, density = 100.0 }
"""
SENSORS = """
[[sensor]]
name = "top"
geom = "ball"
site = "top"
rate = 500.0
[[sensor]]
name = "both sides"
geom = "ball"
points = [[0.3, 0, 0.3], [-0.3, 0, 0.3]]
kind = "velocity"
rate = 500.0
"""
OPTIONS = {"fps": 20, "backend": "cpu"}


def scene_of(folder: Path, sensors: str = SENSORS):
    return load_scene(write_scene(folder, MODEL, SCENE + sensors))


@pytest.fixture
def samples(tmp_path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """What the sensors give in a loop of one's own."""
    simulation = Simulation(scene_of(tmp_path), fps=20, backend="cpu")
    for _ in range(9):
        simulation.advance_frame()
    return {name: (sensor.times, sensor.samples) for name, sensor in simulation.sensors.items()}


def test_exports_hold_the_samples(tmp_path: Path, samples) -> None:
    scene = scene_of(tmp_path)
    both = np.concatenate([values for _, values in samples.values()], axis=1)
    assert np.abs(both).max() > 0.1 and both.shape[1] == 3
    for ending in ("wav", "csv", "parquet", "zarr"):
        if ending in ("parquet", "zarr"):
            pytest.importorskip({"parquet": "pyarrow"}.get(ending, ending))
        export_scene(scene, tmp_path / f"a.{ending}", ExportOptions(signals=True, **OPTIONS))
        # over what was made here
        summary = export_scene(
            scene, tmp_path / f"a.{ending}", ExportOptions(signals=True, **OPTIONS)
        )
        if ending == "wav":
            note = re.match(r"a sample of 1 is (\S+) m/s.*, trusted up to (\S+) Hz", summary.note)
            assert float(note[1]) == pytest.approx(np.abs(both).max() / 0.9, rel=5e-3)
            assert 0 < float(note[2]) <= 0.34 * 500
    with wave.open(str(tmp_path / "a.wav")) as file:
        assert (file.getnchannels(), file.getframerate(), file.getnframes()) == (3, 500, len(both))
        codes = np.frombuffer(file.readframes(len(both)), "<i2").reshape(-1, 3) / 32767
    np.testing.assert_allclose(codes, 0.9 * both / np.abs(both).max(), atol=1e-4)
    with (tmp_path / "a.csv").open(newline="") as file:
        table = [
            row
            for row in csv.DictReader(file)
            if (row["sensor"], row["point"]) == ("both sides", "1")
        ]
    np.testing.assert_allclose([float(row["time [s]"]) for row in table], samples["both sides"][0])
    np.testing.assert_allclose(
        [float(row["value"]) for row in table], samples["both sides"][1][:, 1]
    )
    import pyarrow.parquet
    import zarr

    assert pyarrow.parquet.read_table(tmp_path / "a.parquet").num_rows == sum(
        v.size for _, v in samples.values()
    )
    np.testing.assert_array_equal(
        zarr.open_group(tmp_path / "a.zarr")["sensor_both_sides"], samples["both sides"][1]
    )


def test_a_wav_without_sensors_is_the_sound_at_the_camera(tmp_path: Path) -> None:
    summary = export_scene(
        scene_of(tmp_path, ""), tmp_path / "a.wav", ExportOptions(slow_motion=2.0, **OPTIONS)
    )
    assert re.fullmatch(r"a sample of 1 is \S+ Pa, trusted up to \S+ Hz", summary.note)
    content = (tmp_path / "a.wav").read_bytes()
    assert MARK.encode() in content[:200]
    with wave.open(str(tmp_path / "a.wav")) as file:
        assert (file.getnchannels(), file.getframerate()) == (1, 48_000)
        assert file.getnframes() / 48_000 == pytest.approx(1.0, abs=0.051)
        assert np.abs(np.frombuffer(file.readframes(48_000), "<i2")).max() == 29490


def test_batches_store_the_samples(tmp_path: Path, samples) -> None:
    simulation = Simulation(scene_of(tmp_path), fps=20, backend="cpu")
    record = FrameRecord(tmp_path, StoreEntry(), 10, 20.0)
    for number in range(10):
        if number:
            simulation.advance_frame()
        record(simulation)
    record.finish()
    with np.load(tmp_path / "sensors.npz") as stored:
        for name, (times, values) in samples.items():
            np.testing.assert_array_equal(stored[name], values)
            np.testing.assert_array_equal(stored[f"{name} time"], times)
    low, high = traces(simulation.sensors)[0][2:4]
    assert (low.min(), high.max()) == (samples["top"][1].min(), samples["top"][1].max())


def test_traces_are_drawn(opengl: None, tmp_path: Path) -> None:
    scene = scene_of(tmp_path)
    frames = {}
    for overlay in ((), ("sensors",)):
        options = VideoOptions(size=(640, 360), duration=0.3, overlay=overlay, **OPTIONS)
        render_video(scene, tmp_path / f"frames{len(overlay)}", options)
        frames[overlay] = sorted((tmp_path / f"frames{len(overlay)}").iterdir())[-1].read_bytes()
    assert frames[()] != frames[("sensors",)]


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        (SENSORS + SENSORS, "got two sensors called 'top'"),
        (SENSORS.replace('site = "top"', ""), "sensor 'top' needs one of site, point and points"),
        (SENSORS.replace('site = "top"', 'site = "tip"'), "no site 'tip'; its sites are top"),
        (
            SENSORS.replace('geom = "ball"', 'geom = "bell"'),
            "on 'bell', which does not ripple; targets are 'ball'",
        ),
    ],
)
def test_invalid_sensors_are_refused(sensors: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=message):
        scene_of(tmp_path, sensors)
