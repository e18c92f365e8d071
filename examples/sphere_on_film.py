"""A sphere falls on a stretched film and is thrown back: as in the laboratory?

    python examples/sphere_on_film.py [RESOLUTION ...]

The film is the one of Aguero and others (2022, "Impact of a rigid sphere onto an elastic membrane",
Proceedings of the Royal Society A): with `two_way` the sphere dents it, and the dent throws it
back. Printed are the time in contact, the greatest depth, and when the sphere's lowest point is
back at the height of the film.
"""

import sys

import mujoco
import numpy as np
from scipy.spatial import Delaunay

from ripple_sim import Material, Ripples, Target

# of the sphere [m], [kg], [m/s]
RADIUS = 2.38e-3
MASS = 183.5e-6
SPEED = 0.6312
# radius [m], [kg/m^2], [N/m]
FILM = 52.5e-3
DENSITY = 0.3
TENSION = 107.0
STEP = 1e-5  # [s]
DURATION = 4.5e-3  # [s]
RESOLUTIONS = (48, 96, 128)


def film_mesh(rings: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of a flat disk."""
    points = [(0.0, 0.0)]
    for ring in range(1, rings + 1):
        angles = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        points += list(
            zip(ring / rings * np.cos(angles), ring / rings * np.sin(angles), strict=True)
        )
    plane = FILM * np.array(points)
    return np.column_stack([plane, np.zeros(len(plane))]), Delaunay(plane).simplices


def film_model() -> mujoco.MjModel:
    """A film that is only visible, a plate that collides for it, and the sphere above."""
    V, F = film_mesh()
    numbers = {
        name: " ".join(map(str, values.ravel())) for name, values in (("vertex", V), ("face", F))
    }
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}"/>
        <asset>
        <mesh name="film" inertia="shell" vertex="{numbers["vertex"]}" face="{numbers["face"]}"/>
        </asset>
        <default><geom solref="{2 * STEP} 1" friction="0 0 0" condim="1"/></default><worldbody>
        <geom name="film" type="mesh" mesh="film" contype="0" conaffinity="0"/>
        <geom name="plate" type="cylinder" size="{FILM} 0.005" pos="0 0 -0.005"/>
        <body pos="0 0 {RADIUS}"><freejoint/><geom name="sphere" size="{RADIUS}" mass="{MASS}"/>
        </body>
        </worldbody></mujoco>"""
    )


def fall(resolution: int) -> None:
    """Let the sphere fall, and print what is compared."""
    model = film_model()
    data = mujoco.MjData(model)
    film = Target(
        Material(speed=np.sqrt(TENSION / DENSITY), density=DENSITY),
        resolution=resolution,
        rim="fixed",
        contacts=["plate"],
        limit=False,
    )
    ripples = Ripples(model, {"film": film}, two_way=True)
    data.qvel[2] = -SPEED
    heights = []
    forces = []
    energies = []
    while data.time < DURATION:
        ripples.mj_step(data)
        heights.append(data.qpos[2] - RADIUS)
        forces.append(sum(hit.impulse for hit in ripples.last_impulses) / STEP)
        energies.append(ripples.energy(data).total)
    heights = np.array(heights)
    pressed = np.flatnonzero(np.array(forces) > 0)
    times = STEP * np.arange(1, len(heights) + 1)
    lowest = int(heights.argmin())
    back = float(np.interp(0.0, heights[lowest:], times[lowest:]))
    print(
        f"resolution {resolution}, texels of "
        f"{1e3 * np.sqrt(ripples['film'].atlas.areas.mean()):.2f} mm"
    )
    print(f"  in contact for {1e3 * STEP * (pressed[-1] - pressed[0] + 1):.2f} ms")
    print(f"  greatest depth {-1e3 * heights.min():.3f} mm")
    print(f"  at the film's height again after {1e3 * back:.2f} ms")
    print(
        f"  thrown back with {data.qvel[2] / SPEED:.3f} of its speed; energy kept "
        f"{energies[-1] / energies[0]:.4f}"
    )


def main(*resolutions: int) -> None:
    """Let it fall on films of some resolutions."""
    for resolution in resolutions or RESOLUTIONS:
        fall(resolution)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
