"""Pairs of geoms that approach each other too fast, found before they touch."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, Ints32

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
    target, other = pairs["target"], pairs["other"]
    velocities = _velocities(geom_xpos, cvel, subtree_com, bodies)
    away, relative = geom_xpos[other] - geom_xpos[target], velocities[other] - velocities[target]
    distances, speeds = np.linalg.norm(away, axis=1), np.linalg.norm(relative, axis=1)
    near = distances < pairs["range"] + (1 + steps) * speeds * timestep
    approaching = np.einsum("ij,ij->i", away, relative) < 0
    rows = np.flatnonzero(near & approaching & (speeds * (timestep + pairs["stopping_time"]) > pairs["limit"]))
    return rows, speeds[rows]


def _velocities(geom_xpos: Floats, cvel: Floats, subtree_com: Floats, bodies: Ints32) -> Floats:
    """Velocities of all geoms' centres in the world [m/s], [ngeom, 3]."""
    body, root = bodies.T
    # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
    return cvel[body, 3:] + np.cross(cvel[body, :3], geom_xpos - subtree_com[root])
