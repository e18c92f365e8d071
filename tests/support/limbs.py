"""A sphere, and one with a limb."""

import numpy as np
import trimesh


def arrays(mesh):
    return np.array(mesh.vertices), np.array(mesh.faces)


def sphere(subdivisions=3):
    return arrays(trimesh.creation.icosphere(subdivisions))


def thin_limb(length, radius):
    """A sphere, one of whose sides is drawn out to a limb."""
    V, F = sphere(4)
    up = np.clip((V[:, 2] - 0.8) / 0.2, 0, 1)
    narrow = 1 - (1 - radius) * np.minimum(4 * up, 1)
    return np.column_stack([V[:, 0] * narrow, V[:, 1] * narrow, V[:, 2] + length * up]), F
