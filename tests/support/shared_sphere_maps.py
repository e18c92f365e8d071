"""Sphere maps of meshes that differ in size alone, made once: most of the time that small models' atlases take."""

import contextlib
from collections.abc import Callable, Iterator
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.layouts import build

SphereMap = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]

_known: dict[tuple[str, bytes, bytes], NDArray[np.float64]] = {}


@contextlib.contextmanager
def sharing_sphere_maps() -> Iterator[None]:
    """Within this context `build_atlas` takes a mesh's sphere map from one of the same shape, of whatever size."""
    with patch.dict(build.SPHERE_MAPS, {name: _shared(name, build.SPHERE_MAPS[name]) for name in build.SPHERE_MAPS}):
        yield


def _shared(name: str, sphere_map: SphereMap) -> SphereMap:
    def shared(V: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.float64]:
        shape = np.round((V - V.mean(axis=0)) / np.ptp(V, axis=0).max(), 4) + 0.0
        key = name, shape.tobytes(), F.tobytes()
        if key not in _known:
            # of the shape as it is looked up: what a test sees must not hang on which size came first
            _known[key] = sphere_map(shape, F)
        return _known[key]

    return shared
