"""`Backend`: the methods by which a wave solver drives the fields of a surface.

There are three backends: `CPUBackend`, `GLBackend`, and `FluidBackend` for surfaces with deep fluid
below. `make_backend` makes one by name.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..operator.wave_operator import WaveOperator
from .gl_fields import DeviceField
from .probes import Probes
from .step_kernels import Amplitude
from .surface_fields import SurfaceFields


class TexelLoad(NamedTuple):
    """Forces that act on a surface until others take their place.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices, each once.
    forces : float64 [k]
        On these texels [N].
    acceleration : Amplitude
        Of all texels, as they respond [m/s^2].
    """

    texels: NDArray[np.int64]
    forces: NDArray[np.float64]
    acceleration: Amplitude


NO_LOAD = TexelLoad(np.zeros(0, np.int64), np.zeros(0), 0.0)


class Backend(Protocol):
    """Height and velocity as float32 fields [C, n, n], and the leapfrog substeps that change them.

    Where a backend keeps the volume, forces inside a surface of uneven density do not change the
    volume either; see `volume_rate`.

    Attributes
    ----------
    name : str
        "gl" or "cpu".
    keeps_volume : bool or None
        See `WaveSolver.conserve_volume`; may be changed between steps.
    fields : SurfaceFields
        The height is read and replaced there; the velocity here, since kicks may be only noted.
    """

    name: str
    keeps_volume: bool | None
    fields: SurfaceFields[Any]

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], with all kicks."""

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity [m/s]; earlier kicks are gone."""

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """Copy of the height [m], on the GPU where the waves are there."""

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height since the last call [m]: after any `advance`, or now."""

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add velocities [m/s] to some texels, each named once, and one to all, as they respond."""

    def hold(self, load: TexelLoad) -> None:
        """Let a load act in every substep until the next call."""

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""

    def probed(self) -> NDArray[np.float32]:
        """The sums of the latest `advance`, [substeps, k]."""

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""

    def wait(self) -> None:
        """Return when all steps are done."""

    def finite(self) -> bool:
        """Whether all heights are finite, as far as that is known without waiting."""
