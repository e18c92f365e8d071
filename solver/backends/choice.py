"""The choice of a backend by name, or by speed on this machine."""

from __future__ import annotations

from ..errors import GLError, SolverError
from ..gl import shared_context
from ..operator.deep_water import FluidOperator
from ..operator.wave_operator import WaveOperator
from .backend import Backend
from .backend_speed import measured
from .cpu import CPUBackend
from .fluid import FluidBackend
from .gl import GLBackend

BACKENDS = ("auto", "gl", "cpu")

_TYPICAL_TEXELS = 6 * 128**2  # of a target in a video


def make_backend(
    name: str,
    operator: WaveOperator,
    *,
    keeps_volume: bool | None = False,
    threads: int | None = None,
) -> Backend:
    """A backend by name; "auto" takes the faster one, see `auto_backend`.

    Deep fluid is always computed on the CPU. `threads` is the number of threads of the CPU backend,
    by default as many as pay.

    Raises
    ------
    SolverError
        For an unknown name.
    GLError
        If "gl" is asked for and no context can be made.
    """
    if name not in BACKENDS:
        raise SolverError(f"backend must be one of {', '.join(map(repr, BACKENDS))}, got {name!r}")
    if isinstance(operator, FluidOperator):
        return FluidBackend(operator, keeps_volume=keeps_volume)
    if name == "auto":
        name = auto_backend(operator.mass.size)
    if name == "gl":
        return GLBackend(operator, keeps_volume=keeps_volume)
    return CPUBackend(operator, keeps_volume=keeps_volume, threads=threads)


def auto_backend(texels: int = _TYPICAL_TEXELS) -> str:
    """The backend that "auto" stands for on this machine, for a number of texels: "gl" or "cpu".

    On a hardware driver with compute shaders it is the faster one, measured once. A software driver
    runs on the processor's own cores, where the CPU's loops are many times faster.
    """
    try:
        gl = shared_context()
        if gl.software or not gl.computes:
            return "cpu"
        return measured(gl).faster(texels)
    except GLError:
        return "cpu"
