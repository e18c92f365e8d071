"""Contacts on a sphere of 1 m, geom 0, that has been moved and turned."""

from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.coupling import Contacts, TargetLoad
from ripple_sim.solver import Material, WaveSolver, sphere_atlas

RADII = np.array([1.0, 0.1, 0.1, 0.1])
CONVEX = np.ones(4, dtype=bool)


class Pose(NamedTuple):
    position: np.ndarray
    rotation: np.ndarray


def tilted() -> Pose:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.array([0.8, 0.0, 0.36, 0.48]))
    return Pose(np.array([3.0, -2.0, 5.0]), rotation.reshape(3, 3))


def sphere_load(**material: object) -> TargetLoad:
    waves = WaveSolver(sphere_atlas(1.0, 16), Material(**material), backend="cpu")
    return TargetLoad(waves, 0, RADII, CONVEX)


def contacts_on(pose: Pose, contacts: dict[int, list[tuple[np.ndarray, float]]]) -> Contacts:
    """Contacts by geom: points of the unit sphere in its own frame, and normal forces [N]."""
    normals = np.array([normal for each in contacts.values() for normal, _ in each], dtype=np.float64)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Contacts(
        others=np.repeat(list(contacts), [len(each) for each in contacts.values()]),
        points=pose.position + 1.003 * normals @ pose.rotation.T,
        forces=np.array([force for each in contacts.values() for _, force in each], dtype=np.float64),
        normals=normals @ pose.rotation.T,
    )
