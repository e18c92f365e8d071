"""Materials with every feature that a backend has a code path for."""

from collections.abc import Callable

import numpy as np

from ripple_sim.solver import Atlas, Material


def north(atlas: Atlas) -> np.ndarray:
    return atlas.positions[..., 2] > 0.3


FEATURES: dict[str, Callable[[Atlas], Material]] = {
    "plain": lambda atlas: Material(speed=1.0),
    "damping and density maps": lambda atlas: Material(
        speed=1.0, damping=0.3 * north(atlas), density=1.0 + north(atlas)
    ),
    "speed map": lambda atlas: Material(speed=1.0 + 0.5 * atlas.positions[..., 0]),
    "reflecting region": lambda atlas: Material(speed=1.0 * ~north(atlas)),
    "fixed": lambda atlas: Material(speed=1.0, fixed=north(atlas)),
    "viscosity": lambda atlas: Material(speed=1.0, viscosity=1e-3),
    "bending and viscosity": lambda atlas: Material(speed=0.5, bending=1e-4, viscosity=1e-3),
    "yield map": lambda atlas: Material(speed=1.0, yield_height=np.where(north(atlas), 5e-3, np.inf), stiffness=10.0),
}
