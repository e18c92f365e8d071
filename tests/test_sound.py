"""Sound: Rayleigh's integral for a piston, partials of drums, and the video's track."""

import math
import wave
from pathlib import Path

import av
import numpy as np
import pytest
from hand_made import disk, square
from scipy.special import jn_zeros
from unfinished_videos import egg_scene

from ripple_sim import Material, VideoOptions, load_scene, render_video
from ripple_sim.encode.clip import H264, Clip, Stream, join_clips
from ripple_sim.errors import VideoError
from ripple_sim.scene.scene_file import uniform_material
from ripple_sim.solver import Mesh, WaveSolver, build_atlas, load_mesh, modes, texel_atlas
from ripple_sim.sound import DENSITY, RATE, SPEED, Ear, gain, write_wav


@pytest.mark.parametrize("backend", ["cpu", "gl"])
def test_a_piston_sounds_on_its_axis_as_theory_says(opengl: None, backend: str) -> None:
    """A sudden velocity v sounds as rho c v until the edge is heard (Stepanishen 1971)."""
    atlas = texel_atlas(disk(24))
    timestep = 2e-5  # [s]
    speed = 0.01  # of the piston [m/s]
    away = 0.8  # from the piston to the ear [m]
    waves = WaveSolver(atlas, Material(speed=0.01), backend=backend, conserve_volume=False)
    ear = Ear(waves, timestep)
    middle = atlas.positions.reshape(-1, 3).mean(axis=0)
    ear.stand(waves, middle + np.array([0, 0, away]))
    waves.velocity = speed
    for _ in range(20):
        waves.step(timestep)
    at = np.arange(int(0.006 * RATE)) / RATE
    pressure = ear.heard(at, RATE)
    radius = math.sqrt(atlas.areas.sum() / math.pi)
    to_edge = math.hypot(away, radius)
    begins = away / SPEED
    ends = to_edge / SPEED
    # the filter of the samples rings for some tenths of a millisecond at both ends
    during = (at > begins + 4e-4) & (at < ends - 4e-4)
    silent = (at < begins - 8e-4) | (at > ends + 8e-4)
    plateau = DENSITY * SPEED * speed  # [Pa]
    assert during.sum() > 3
    # the sound of the texels arrives one by one
    assert pressure[during].mean() == pytest.approx(plateau, rel=0.01)
    assert pressure[during].std() < 0.05 * plateau
    assert np.abs(pressure[silent]).max() < 0.05 * plateau
    assert pressure.sum() / RATE == pytest.approx(DENSITY * speed * (to_edge - away), rel=5e-3)


def square_mesh(side: float) -> Mesh:
    """A flat square, triangles in rows."""
    count = 13
    x, y = np.meshgrid(*2 * [np.linspace(0, side, count)], indexing="ij")
    node = np.arange(count**2).reshape(count, count)
    a, b, c, d = (
        each.ravel() for each in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh.from_arrays(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), triangles)


def test_a_place_that_moves_hears_a_tone_without_clicks_and_lower_as_it_recedes() -> None:
    """Placed anew 30 times a second; delays that jumped then left nothing of a tone at each."""
    side = 0.2
    tone = 1000.0
    away = 3.0
    frames = 12
    fps = 30
    atlas = build_atlas(square_mesh(side), resolution=32, cache=False)
    for speed in (0.0, 3.0):
        material = Material(speed=math.sqrt(2) * side * tone)
        waves = WaveSolver(atlas, material, rim="fixed", backend="cpu")
        waves.velocity = modes(atlas, material, 1, rim="fixed").shapes[0]  # one tone alone
        ear = Ear(waves, 1e-3)
        for frame in range(frames):
            ear.stand(waves, np.array([side / 2, side / 2, away + speed * frame / fps]))
            waves.step(1 / fps)
        at = np.arange(int(0.05 * RATE), int(frames / fps * RATE)) / RATE
        heard = ear.heard(at, RATE)[: -RATE // 50]
        swing = 2 * np.pi * tone / RATE
        assert np.abs(np.diff(heard, 2)).max() < 1.1 * swing**2 * np.abs(heard).max()
        spectrum = np.abs(np.fft.rfft(heard * np.blackman(len(heard)), 1 << 18))
        frequency = np.fft.rfftfreq(1 << 18, 1 / RATE)
        peak = frequency[spectrum.argmax()]
        near = np.abs(frequency - peak) < 30
        assert 10 * np.log10((spectrum[~near] ** 2).sum() / (spectrum[near] ** 2).sum()) < -50
        if not speed:
            at_rest = peak
    assert peak == pytest.approx(at_rest * (1 - 3.0 / SPEED), abs=0.3)


def test_nothing_is_heard_from_behind() -> None:
    waves = WaveSolver(texel_atlas(square(12)), backend="cpu", conserve_volume=False)
    ear = Ear(waves, 0.01)
    ear.stand(waves, np.array([0.5, 0.5, -1.0]))
    waves.velocity = 1.0
    waves.step(0.01)
    assert not ear.heard(np.arange(100) / RATE, RATE).any()


def test_a_run_too_short_for_a_sample_is_an_empty_sound() -> None:
    waves = WaveSolver(texel_atlas(square(12)), backend="cpu")
    ear = Ear(waves, 0.01)
    ear.stand(waves, np.array([0.5, 0.5, 1.0]))
    waves.step(0.01)
    assert ear.heard(np.zeros(0), RATE).shape == (0,)


# wave numbers of a membrane with a fixed rim, times its radius: those with 0, 1 and 2 nodal lines
SKIN = sorted(jn_zeros(0, 2)[:1].tolist() + jn_zeros(1, 1).tolist() + jn_zeros(2, 1).tolist())
# of a free plate their squares (Leissa 1969, Poisson's ratio 0.3)
FREE = [5.358, 9.003, 12.439]


@pytest.mark.parametrize(
    ("name", "radius", "duration"), [("low", 0.16, 0.3), ("bronze", 0.1185, 0.15)]
)
def test_partials_of_the_drums_are_at_their_modes(
    name: str, radius: float, duration: float
) -> None:
    scene = load_scene("drums")
    (entry,) = (each for each in scene.targets if each.geom == name)
    mesh = load_mesh(Path(__file__).parents[1] / "scenes" / "meshes" / "drum_skin.obj")
    atlas = build_atlas(type(mesh)(radius / 0.4 * mesh.V, mesh.F), entry.resolution, cache=False)
    material = uniform_material(entry)
    waves = WaveSolver(
        atlas, material, rim=entry.rim, backend="cpu", conserve_volume=entry.conserve_volume
    )
    center = atlas.mesh.V.mean(axis=0)
    ear = Ear(waves, duration)
    ear.stand(waves, center + np.array([0.3, 0, 0.5]))
    waves.add_impulse(center + np.array([0.45 * radius, 0, 0]), 1e-3, 0.15 * radius)
    waves.step(duration)
    pressure = ear.heard(np.arange(int(duration * RATE)) / RATE, RATE)
    heard = np.abs(np.fft.rfft(pressure * np.hanning(len(pressure)), 1 << 18))
    hertz = np.fft.rfftfreq(1 << 18, 1 / RATE)
    if entry.rim == "free":
        swings = math.sqrt(material.bending) * np.array(FREE) / radius**2
    else:
        swings = material.speed * np.array(SKIN) / radius
    for mode in np.sqrt(swings**2 + material.stiffness) / (2 * math.pi):
        near = np.abs(hertz - mode) < 0.04 * mode
        peak = hertz[near][heard[near].argmax()]
        assert peak == pytest.approx(mode, rel=0.01)
        # a peak, not a slope's end
        assert heard[near].max() > 3 * np.median(heard[(hertz > 0.7 * mode) & (hertz < 1.4 * mode)])


def test_a_video_carries_the_sound_passed_to_it(tmp_path: Path) -> None:
    sound = 0.5 * np.sin(2 * np.pi * 440 * np.arange(RATE) / RATE)
    clip = Clip(tmp_path / "clip.mp4", H264, Stream(32, 16, 24))
    for _ in range(24):
        clip.write(np.zeros((16, 32, 3), np.uint8))
    clip.finish()
    whole = []
    for name in ("a.mp4", "b.mp4"):
        join_clips([(tmp_path / "clip.mp4", 0)], tmp_path / name, "mp4", 24, sound)
        whole.append((tmp_path / name).read_bytes())
    assert whole[0] == whole[1]
    with av.open(str(tmp_path / "a.mp4")) as file:
        track = file.streams.audio[0]
        assert (track.codec_context.name, track.rate, track.layout.name) == ("aac", RATE, "mono")
        heard = np.concatenate([frame.to_ndarray()[0] for frame in file.decode(track)])
    assert RATE <= len(heard) < RATE + 1024  # whole blocks
    assert np.abs(heard[:RATE] - sound)[2000:-2000].max() < 0.01  # in time to the sample


def test_a_video_with_sound(opengl: None, tmp_path: Path) -> None:
    options = VideoOptions(
        size=(32, 32), fps=10, duration=0.3, slow_motion=2.0, sound=True, overlay=()
    )
    said = "is hardly heard: waves of .* m and longer sound at .* Hz at most, below hearing"
    with pytest.warns(UserWarning, match=said):
        render_video(egg_scene(tmp_path), tmp_path / "a.mp4", options)
    with av.open(str(tmp_path / "a.mp4")) as file:
        assert float(
            file.streams.audio[0].duration * file.streams.audio[0].time_base
        ) == pytest.approx(0.6, abs=0.03)
    with pytest.raises(VideoError, match=r"has no sound: write \.mp4 or \.webm"):
        render_video(egg_scene(tmp_path), tmp_path / "a.gif", options)


def test_a_wav_file_has_its_rate_and_its_samples(tmp_path: Path) -> None:
    pressure = np.array([0.0, 20.0, -40.0])
    write_wav(tmp_path / "a.wav", np.stack([pressure, -pressure], axis=1) * gain(pressure), RATE)
    with wave.open(str(tmp_path / "a.wav")) as file:
        assert (file.getframerate(), file.getnchannels(), file.getnframes()) == (RATE, 2, 3)
        codes = np.frombuffer(file.readframes(3), "<i2").reshape(3, 2)
    np.testing.assert_array_equal(codes[:, 0], [0, 14745, -29490])
    assert gain(np.zeros(3)) == 1.0
