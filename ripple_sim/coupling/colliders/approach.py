"""Pairs of geoms that approach each other too fast, found before they touch."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, Ints32, kernel

# A pair to watch.
APPROACH = np.dtype(
    [
        ("target", np.int64),  # geom ids
        ("other", np.int64),
        ("limit", np.float64),  # depth up to which a contact is safe [m]
        ("range", np.float64),  # distance of the geoms' centres at which they may touch [m]
        ("stopping_time", np.float64),  # depth over speed after the first contact [s]
    ]
)


@kernel
def too_fast(
    pairs: np.ndarray,
    geom_xpos: Floats,
    cvel: Floats,
    subtree_com: Floats,
    bodies: Ints32,
    timestep: float,
    steps: int,
) -> tuple[Ints, Floats]:
    """Find pairs that may touch within some steps and would sink in beyond their limits.

    Parameters
    ----------
    pairs : APPROACH [p]
    geom_xpos, cvel, subtree_com
        From MuJoCo's data.
    bodies : int32 [ngeom, 2]
        Body of each geom, and the root of that body's tree.
    timestep : float
        [s].
    steps : int

    Returns
    -------
    rows : int64 [k]
        Rows of the pairs.
    speeds : float64 [k]
        Their relative speeds [m/s].
    """
    found, speeds = np.empty(len(pairs), np.int64), np.empty(len(pairs))
    count = 0
    velocities = _velocities(geom_xpos, cvel, subtree_com, bodies)
    for i in range(len(pairs)):
        pair = pairs[i]
        away2, speed2, approach = 0.0, 0.0, 0.0
        for k in range(3):
            x = geom_xpos[pair.other, k] - geom_xpos[pair.target, k]
            v = velocities[pair.other, k] - velocities[pair.target, k]
            away2, speed2, approach = away2 + x * x, speed2 + v * v, approach - x * v
        speed = np.sqrt(speed2)
        near = np.sqrt(away2) < pair.range + (1 + steps) * speed * timestep
        if near and approach > 0 and speed * (timestep + pair.stopping_time) > pair.limit:
            found[count], speeds[count] = i, speed
            count += 1
    return found[:count], speeds[:count]


@kernel
def _velocities(geom_xpos: Floats, cvel: Floats, subtree_com: Floats, bodies: Ints32) -> Floats:
    """Velocities of all geoms' centres in the world [m/s], [ngeom, 3]."""
    found = np.empty((len(bodies), 3))
    for geom in range(len(bodies)):
        body, root = bodies[geom, 0], bodies[geom, 1]
        for k in range(3):
            # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
            y, z = (k + 1) % 3, (k + 2) % 3
            turning = cvel[body, y] * (geom_xpos[geom, z] - subtree_com[root, z])
            turning -= cvel[body, z] * (geom_xpos[geom, y] - subtree_com[root, y])
            found[geom, k] = cvel[body, 3 + k] + turning
    return found
