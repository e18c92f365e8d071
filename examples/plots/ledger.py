"""The energy of a bouncing ball: bodies, waves and both; one-way and two-way coupling.

    python examples/plots/ledger.py

writes out/plots/ledger.png. Contacts and waves are without damping; heights count from where the
ball touches.
"""

from pathlib import Path

import mujoco
import numpy as np
from figure import COLORS, FOLDER, TEXT, plain, save, sheet

from ripple_sim import Material, Ripples

# m, s
FALL = 0.24
DURATION = 2.0
CURVES = {"bodies": COLORS["paper"], "waves": COLORS["fem"], "total": TEXT}
SCENE = f"""<mujoco><option timestep="0.0005"/><default><geom solref="-20000 0"/></default>
<worldbody>
<geom name="block" type="box" size="0.5 0.5 0.1" pos="0 0 -0.1"/>
<body pos="0.03 0.02 {0.06 + FALL}"><freejoint/><geom size="0.06" mass="0.5"/></body></worldbody>
</mujoco>"""


def ledger(*, two_way: bool) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times [s], and energies [J] by name."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    material = Material(1.0, 0.0, 3e4, density=100.0)
    ripples = Ripples(model, {"block": material}, resolution=24, backend="cpu", two_way=two_way)
    ripples.allow_any_height("block")
    touching = -0.5 * model.opt.gravity[2] * 0.06
    times = []
    energies = []
    while data.time < DURATION:
        ripples.mj_step(data)
        energy = ripples.energy(data)
        times.append(data.time)
        energies.append((energy.bodies - touching, energy.waves, energy.total - touching))
    return np.array(times), dict(zip(CURVES, np.array(energies).T, strict=True))


def make(folder: Path) -> Path:
    figure = sheet(
        13.0,
        4.9,
        "Ledger of a bouncing ball",
        "500 g fall 24 cm on a surface of 100 kg/m^2, without any damping",
    )
    one_way, two_way = (ledger(two_way=each) for each in (False, True))
    for left, title, (times, energies) in ((0.06, "one-way", one_way), (0.56, "two-way", two_way)):
        axes = figure.add_axes((left, 0.13, 0.40, 0.61))
        plain(axes, "time [s]", "energy [J]")
        axes.set_title(title, fontsize=11, color=TEXT, loc="left")
        for name, values in energies.items():
            axes.plot(
                times,
                values,
                color=CURVES[name],
                linewidth=2.0 if name == "total" else 1.4,
                label=name,
            )
        axes.legend(frameon=False, fontsize=9.5, labelcolor=TEXT, ncols=3, loc="upper left")
        axes.set_ylim(0, 1.25 * max(values.max() for values in energies.values()))
    return save(figure, folder, "ledger")


if __name__ == "__main__":
    print(make(FOLDER))
