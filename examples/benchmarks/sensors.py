"""Cost of eight sensors in a physics step, and of the sound of the drums.

And what an accelerometer hears of a hit, by MuJoCo's contact and by Hertz's law.

    python examples/benchmarks/sensors.py

Processor time, runs with and without taking turns; medians over frames.
"""

import time

import mujoco
import numpy as np

from ripple_sim import Material, Ripples
from ripple_sim.scene import load_scene
from ripple_sim.simulation import Simulation
from ripple_sim.sound import Microphone

# [s]
FRAMES = 240
SOUND = 0.5


def add_sensors(simulation: Simulation) -> None:
    """Eight points of the drum's skin, at random."""
    waves = simulation.ripples["skin"]
    rng = np.random.default_rng(0)
    chosen = rng.choice(waves.atlas.areas.size, 8, replace=False)
    simulation.sensors["skin"] = waves.sensor(
        waves.atlas.positions.reshape(-1, 3)[chosen], rate=2000
    )


BOARD = """
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <geom name="board" type="box" size="0.15 0.1 0.01"/>
    <body pos="0 0 0.116"><freejoint/><geom size="0.0055" mass="0.005"/></body>
  </worldbody>
</mujoco>
"""


BANDS = (100, 500, 1000, 5000)  # [Hz]


def levels(pulse: str) -> list[float]:
    """Levels of an accelerometer in these bands [dB re 1 m/s^2]: a steel ball on a board."""
    model = mujoco.MjModel.from_xml_string(BOARD)
    data = mujoco.MjData(model)
    board = Material(speed=200.0, density=5.0, damping=100.0)
    ripples = Ripples(
        model, {"board": board}, resolution=24, backend="cpu", pulse=pulse, modulus=1e9
    )
    sensor = ripples["board"].sensor([0.1, 0.05, 0.01], rate=16_000)
    ripples.mj_step(data, nstep=400)
    samples = sensor.read().values[:, 0]
    energy = 2 * np.abs(np.fft.rfft(samples) / len(samples)) ** 2
    which = np.digitize(np.fft.rfftfreq(len(samples), 1 / sensor.rate), BANDS)
    return [10 * np.log10(energy[which == band].sum()) for band in range(1, len(BANDS))]


def main() -> None:
    runs = [Simulation(load_scene("drum"), fps=60, backend="cpu") for _ in range(2)]
    add_sensors(runs[1])
    seconds: list[list[float]] = [[], [], []]
    for frame in range(FRAMES):
        for k in (0, 1) if frame % 2 else (1, 0):
            begun = time.process_time()
            runs[k].advance_frame()
            seconds[k].append((time.process_time() - begun) / runs[k].steps_per_frame)
        begun = time.process_time()
        runs[1].sensors["skin"].read()
        seconds[2].append((time.process_time() - begun) / runs[1].steps_per_frame)
    plain, measured, read = (1e3 * np.median(each) for each in seconds)
    print(
        f"drum: a step {plain:.3f} ms, with eight points {measured:.3f} ms, and {read:.3f} ms more "
        f"with reading"
    )

    drums = Simulation(load_scene("drums"), fps=60, backend="cpu")
    drums.advance_frame()
    taken = []
    for heard in (False, True):
        drums.reset()
        begun = time.process_time()
        microphone = Microphone(drums.ripples) if heard else None
        for _ in range(round(60 * SOUND)):
            if microphone is not None:
                microphone.follow(drums)
            drums.advance_frame()
        if microphone is not None:
            microphone.pressure(SOUND)
        taken.append((time.process_time() - begun) / SOUND)
    print(
        f"drums: {taken[0]:.1f} s of processor time a second of the scene, {taken[1]:.1f} s with "
        f"sound"
    )

    for pulse in ("contact", "hertz"):
        told = (
            f"{low} to {high} Hz {level:.0f}"
            for low, high, level in zip(BANDS[:-1], BANDS[1:], levels(pulse), strict=True)
        )
        print(f"pulse {pulse!r} [dB re 1 m/s^2]: {', '.join(told)}")


if __name__ == "__main__":
    main()
