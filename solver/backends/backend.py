"""The backends' protocol, and backends by name."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import GLError, SolverError
from ripple_sim.solver.operator.fluid_operator import FluidOperator
from ripple_sim.solver.operator.wave_operator import WaveOperator

from .arguments import Amplitude
from .device_field import DeviceField

BACKENDS = ("auto", "gl", "cpu")

_TYPICAL = 6 * 128**2  # texels of a video's target


class Backend(Protocol):
    """A backend holds height and velocity as float32, kicks texels, and takes leapfrog substeps.

    `move` takes over the stencils of the same surface with its texels elsewhere.

    Where it keeps the volume, forces inside a surface of uneven density do not change it either; see `volume_rate`.
    """

    name: str
    keeps_volume: bool

    def height(self) -> NDArray[np.float32]: ...  # noqa: D102
    def snapshot(self) -> NDArray[np.float32] | DeviceField: ...  # noqa: D102
    def crests(self) -> NDArray[np.float32]: ...  # noqa: D102
    def velocity(self) -> NDArray[np.float32]: ...  # noqa: D102
    def elastic(self) -> NDArray[np.float32]: ...  # noqa: D102
    def dent(self) -> NDArray[np.float32]: ...  # noqa: D102
    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None: ...  # noqa: D102
    def set_velocity(self, velocity: NDArray[np.float32]) -> None: ...  # noqa: D102
    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude) -> None: ...  # noqa: D102
    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude) -> None: ...  # noqa: D102
    def advance(self, substeps: int, dt: float) -> None: ...  # noqa: D102
    def move(self, operator: WaveOperator) -> None: ...  # noqa: D102
    def wait(self) -> None: ...  # noqa: D102
    def finite(self) -> bool: ...  # noqa: D102


def make_backend(name: str, operator: WaveOperator, *, keeps_volume: bool = False) -> Backend:
    """Backend by name; "auto" takes the faster one, see `auto_backend`. Deep fluid is always on the CPU.

    Raises
    ------
    SolverError
        For an unknown name.
    GLError
        If "gl" is asked for and no context can be made.
    """
    if name not in BACKENDS:
        raise SolverError(f"backend {name!r} does not exist; valid are {', '.join(map(repr, BACKENDS))}")
    if name == "auto":
        name = auto_backend(operator.mass.size)
    if isinstance(operator, FluidOperator):
        from .fluid import FluidBackend

        return FluidBackend(operator, keeps_volume=keeps_volume)
    if name == "gl":
        from .gl import GLBackend

        return GLBackend(operator, keeps_volume=keeps_volume)
    from .cpu import CPUBackend

    return CPUBackend(operator, keeps_volume=keeps_volume)


def auto_backend(texels: int = _TYPICAL) -> str:
    """Backend that "auto" stands for on this machine for so many texels: "gl" or "cpu".

    On a hardware driver the faster one, measured once; a software driver runs on the processor's own cores, where the
    CPU's loops are many times faster.
    """
    from ripple_sim.solver.gl import shared_context

    try:
        gl = shared_context()
        if gl.software:
            return "cpu"
        from .measured import measured

        return measured(gl).faster(texels)
    except GLError:
        return "cpu"
