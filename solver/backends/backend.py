"""`Backend`: what holds height and velocity as float32, kicks texels, and takes leapfrog substeps; which is the faster.

Where one keeps the volume, forces inside a surface of uneven density do not change it either; see
`volume_rate`. Which is the faster on this machine is measured once, and remembered in the user's
cache folder.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import itertools
import os
import platform
import time
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..cache import cache_limit, cache_path, mark_used
from ..errors import GLError, SolverError
from ..files import atomic_write
from ..gl import GLContext, shared_context
from ..layouts.cube.convention import cube_topology
from ..operator.deep_water import FluidOperator
from ..operator.step import damped_step
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import Stencil
from .cpu import CPUBackend, RowLayout
from .field_backend import FieldBackend
from .gl import GLBackend
from .kernels import Amplitude, Probes

BACKENDS = ("auto", "gl", "cpu")

_TYPICAL = 6 * 128**2  # texels of a video's target

# Texels along a chart's side of the two sizes that are measured, and substeps of a frame.
_SIZES = (64, 192)
_SUBSTEPS = 9

# How long each backend is measured at each size [s], and how often at least.
_SPELL = 0.03
_LEAST = 3


class FluidBackend(FieldBackend):
    """Surfaces with deep fluid below: shifted sparse solves on the CPU, whatever draws the frames; see `Backend`.

    The fluid keeps its volume, asked to or not.
    """

    name = "cpu"
    _operator: FluidOperator

    def __init__(self, operator: FluidOperator, *, keeps_volume: bool | None = False) -> None:
        self._operator = operator
        self.keeps_volume = keeps_volume
        self._fields = RowLayout(operator.topology)
        self._h = self._fields.zeros()
        self._v = self._fields.zeros()
        self._forces = np.zeros(operator.mass.size)

    def move(self, operator: WaveOperator) -> None:
        """Refuse: this backend cannot move; see `MovingOperator`."""
        raise NotImplementedError

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add momenta to some texels, given as the velocities [m/s] that their own mass would have.

        The fluid hands them on, and lets none of their mean through.
        """
        momentum = np.zeros(self._operator.mass.size)
        momentum[texels] = velocities * self._operator.mass.reshape(-1)[texels]
        change = self._operator.acceleration(momentum.reshape(self._operator.mass.shape))
        self._fields.write(self._v, self.velocity() + change)

    def load(
        self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude
    ) -> None:
        """Hold forces [N] on some texels until the next call."""
        self._forces[:] = 0.0
        self._forces[texels] = forces

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        operator = self._operator
        loads = self._forces.reshape(self._operator.mass.shape)
        decay, span = damped_step(operator, dt)
        h = self.elastic().astype(np.float64)
        v = self.velocity().astype(np.float64)
        dent = self.dent()
        h += dt / 2 * v
        self._sums = np.zeros(
            (substeps, 0 if self._probes is None else len(self._probes.heights)), np.float32
        )
        for step in range(substeps):
            change = operator.acceleration(operator.elastic_force(h) + loads)
            if operator.viscosity_stencil is not None:
                change += operator.viscosity_stencil(v) / operator.mass * operator.free
            v = decay * v + span * change
            if self._probes is not None:
                self._sums[step] = self._probes.of(h + dt / 2 * v + dent, v)
            h += (dt if step < substeps - 1 else dt / 2) * v
        self._fields.write(self._h, h)
        self._fields.write(self._v, v)
        if self._crests is not None:
            self._raise_crests()

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        self._probes = probes


Backend: TypeAlias = CPUBackend | GLBackend | FluidBackend


def make_backend(
    name: str, operator: WaveOperator, *, keeps_volume: bool | None = False
) -> Backend:
    """Backend by name; "auto" takes the faster one, see `auto_backend`.

    Deep fluid is always on the CPU.

    Raises
    ------
    SolverError
        For an unknown name.
    GLError
        If "gl" is asked for and no context can be made.
    """
    if name not in BACKENDS:
        raise SolverError(
            f"backend {name!r} does not exist; valid are {', '.join(map(repr, BACKENDS))}"
        )
    if isinstance(operator, FluidOperator):
        return FluidBackend(operator, keeps_volume=keeps_volume)
    if name == "auto":
        name = auto_backend(operator.mass.size)
    return (GLBackend if name == "gl" else CPUBackend)(operator, keeps_volume=keeps_volume)


def auto_backend(texels: int = _TYPICAL) -> str:
    """Backend that "auto" stands for on this machine for so many texels: "gl" or "cpu".

    On a hardware driver with compute shaders the faster one, measured once; a software driver runs
    on the processor's own cores, where the CPU's loops are many times faster.
    """
    try:
        gl = shared_context()
        if gl.software or not gl.computes:
            return "cpu"
        return measured(gl).faster(texels)
    except GLError:
        return "cpu"


class Measured(NamedTuple):
    """Seconds that nine substeps take on both backends, at two sizes in texels."""

    texels: tuple[float, float]
    gl: tuple[float, float]
    cpu: tuple[float, float]

    def faster(self, texels: int) -> str:
        """The faster backend, "gl" or "cpu", of so many texels: time is taken to be linear in their number."""
        share = (texels - self.texels[0]) / (self.texels[1] - self.texels[0])
        gl, cpu = (each[0] + share * (each[1] - each[0]) for each in (self.gl, self.cpu))
        return "gl" if gl < cpu else "cpu"

    def __str__(self) -> str:
        rows = zip(self.texels, self.gl, self.cpu, strict=True)
        return "; ".join(
            f"{n:,.0f} texels: {1e3 * gl:.2f} ms GL, {1e3 * cpu:.2f} ms CPU" for n, gl, cpu in rows
        )


@functools.cache
def measured(gl: GLContext) -> Measured:
    """The measurement of a device and its driver on this machine, taken now if there is none in the cache."""
    program = importlib.metadata.version("ripple-sim")
    path = cache_path(
        f"backends {gl.renderer} {gl.version} {platform.machine()} {os.cpu_count()} {program}", []
    )
    with contextlib.suppress(OSError, ValueError, KeyError):
        with np.load(path, allow_pickle=False) as kept:
            known = Measured(*(tuple(kept[name].tolist()) for name in Measured._fields))
        mark_used(path)
        return known
    found = measure(gl)
    if cache_limit():
        # one that cannot be written is measured again by the next process
        with (
            contextlib.suppress(OSError),
            atomic_write(path) as unfinished,
            unfinished.open("wb") as file,
        ):
            np.savez(file, allow_pickle=False, **found._asdict())
    return found


def measure(gl: GLContext) -> Measured:
    """Time both backends at both sizes."""
    times: dict[str, list[float]] = {"gl": [], "cpu": []}
    for n in _SIZES:
        # on a cube, without links: the time does not depend on the numbers
        topology = cube_topology(n)
        ones = np.ones(topology.shape)
        operator = WaveOperator(
            Stencil(topology, np.zeros((6, 4, n + 1, n + 1))), ones, 0 * ones, 0 * ones
        )
        for backend in (GLBackend(operator, gl), CPUBackend(operator)):
            times[backend.name].append(_seconds(backend))
    texels = [6.0 * n * n for n in _SIZES]
    return Measured(*(tuple(each) for each in (texels, times["gl"], times["cpu"])))  # type: ignore[arg-type]


def _seconds(backend: GLBackend | CPUBackend) -> float:
    """The least time of a frame's substeps [s]; the first, which compiles, does not count."""
    ends: list[float] = []
    while len(ends) <= _LEAST or ends[-1] - ends[0] < _SPELL:
        backend.advance(_SUBSTEPS, 1e-3)
        backend.wait()
        ends.append(time.perf_counter())
    return min(end - start for start, end in itertools.pairwise(ends))
