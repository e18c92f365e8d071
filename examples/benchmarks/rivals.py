"""Speed of the wave step against kernels written by hand: ratios and rates by resolution.

    python examples/benchmarks/rivals.py [--resolutions 128,256,512]

The naive loop is the nine-point stencil over charts with halo, as a competent user of numba writes
it first, in one thread or, with `prange`, in all: it has the solver's own weights, and no tuning.
This is the rival that counts, since anyone has it in a quarter of an hour. SciPy's sparse matrix,
in one thread, is what one would write in an afternoon. The plain compute shader has one thread a
texel, everything in storage buffers, no tiles and nothing packed. All take turns, so that a busy
machine slows all alike; rates are texel updates a second, in millions.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import moderngl
import numba
import numpy as np
from scipy.sparse import diags_array

from ripple_sim.bench import Advance, backend_advance, memory_fields, memory_stream, race, table
from ripple_sim.solver import GLError, Material, build_operator, sphere_atlas
from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.kernel import Floats32, Ints, kernel
from ripple_sim.solver.operator import WaveOperator
from ripple_sim.solver.texels import stiffness_matrix


class NaiveLoop:
    """Leapfrog in a plain loop, in one thread or, with `parallel`, in numba's threads."""

    def __init__(self, operator: WaveOperator, parallel: bool = False) -> None:
        n = operator.mass.shape[1]
        self._weights = operator.stencil.weights.astype(np.float32)
        self._gain = (1 / operator.mass).astype(np.float32)
        _, self._halo, self._source = operator.topology.addresses
        self._h = np.zeros((6, n + 2, n + 2), np.float32)
        self._h_next = np.zeros_like(self._h)
        self._v = np.zeros((6, n, n), np.float32)
        self._update = _update_parallel if parallel else _update

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        self._h[:, 1:-1, 1:-1] = height

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        return self._h[:, 1:-1, 1:-1].copy(), self._v.copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            _fill_halo(self._h.reshape(-1), self._halo, self._source)
            fields = Fields(self._weights, self._h, self._h_next, self._v, self._gain)
            self._update(fields, np.float32(dt))
            self._h, self._h_next = self._h_next, self._h


@kernel
def _fill_halo(h: Floats32, halo: Ints, source: Ints) -> None:
    for i in range(len(halo)):
        h[halo[i]] = h[source[i]]


class Fields(NamedTuple):
    """Weights [C, 4, n + 1, n + 1], heights [C, n + 2, n + 2], velocity and gain [C, n, n]."""

    w: Floats32
    h: Floats32
    h_next: Floats32
    v: Floats32
    gain: Floats32


@kernel
def _update_row(fields: Fields, dt: np.float32, i: int) -> None:
    w, h, h_next, v, gain = fields
    n = v.shape[1]
    f = i // n
    r = i % n + 1
    for c in range(1, n + 1):
        x = h[f, r, c]
        force = w[f, 0, r, c] * (h[f, r, c + 1] - x) + w[f, 0, r, c - 1] * (h[f, r, c - 1] - x)
        force += w[f, 1, r, c] * (h[f, r + 1, c] - x) + w[f, 1, r - 1, c] * (h[f, r - 1, c] - x)
        force += w[f, 2, r, c] * (h[f, r + 1, c + 1] - x) + w[f, 2, r - 1, c - 1] * (
            h[f, r - 1, c - 1] - x
        )
        force += w[f, 3, r, c - 1] * (h[f, r + 1, c - 1] - x) + w[f, 3, r - 1, c] * (
            h[f, r - 1, c + 1] - x
        )
        v[f, r - 1, c - 1] += dt * gain[f, r - 1, c - 1] * force
        h_next[f, r, c] = x + dt * v[f, r - 1, c - 1]


@kernel
def _update(fields: Fields, dt: np.float32) -> None:
    for i in range(6 * fields.v.shape[1]):
        _update_row(fields, dt, i)


@kernel(parallel=True)
def _update_parallel(fields: Fields, dt: np.float32) -> None:
    for i in numba.prange(6 * fields.v.shape[1]):
        _update_row(fields, dt, i)


_GROUP = 64


UPDATE = Path(__file__).with_name("plain_update.glsl")
_HALO = """#version 430
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Field { float x[]; };
// (place in the halo, texel that it copies)
layout(std430, binding = 1) readonly buffer Pairs { ivec2 pairs[]; };
uniform int count;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i < count) x[pairs[i].x] = x[pairs[i].y];
}
"""


class PlainShader:
    """Leapfrog with a dispatch for the charts' halos and one for the update, each substep."""

    def __init__(self, operator: WaveOperator) -> None:
        self._gl = shared_context()
        self._n = n = operator.mass.shape[1]
        _, ghosts, sources = operator.topology.addresses
        with self._gl as ctx:
            self._h, self._h_next, self._v = (
                ctx.buffer(reserve=4 * 6 * (n + 2) ** 2) for _ in range(3)
            )
            for buffer in (self._h, self._h_next, self._v):
                buffer.clear()
            self._stencil = ctx.buffer(operator.stencil.weights.astype(np.float32).tobytes())
            self._gain = ctx.buffer((1 / operator.mass).astype(np.float32).tobytes())
            self._pairs = ctx.buffer(np.stack([ghosts, sources], axis=1).astype(np.int32).tobytes())
            version = "#version 430\n"
            update = UPDATE.read_text().replace(version, f"{version}#define N {n}\n")
            self._update = ctx.compute_shader(update)
            self._halo = ctx.compute_shader(_HALO)
        self._count = len(ghosts)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        with_halo = np.pad(height.astype(np.float32), ((0, 0), (1, 1), (1, 1)))
        with self._gl:
            self._h.write(with_halo.tobytes())

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        shape = (6, self._n + 2, self._n + 2)
        with self._gl:
            h, v = (
                np.frombuffer(each.read(), np.float32).reshape(shape) for each in (self._h, self._v)
            )
        return h[:, 1:-1, 1:-1].copy(), v[:, 1:-1, 1:-1].copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps, and wait for them."""
        with self._gl as ctx:
            self._halo["count"] = self._count
            self._update["dt"] = dt
            for _ in range(substeps):
                self._h.bind_to_storage_buffer(0)
                self._pairs.bind_to_storage_buffer(1)
                self._halo.run(-(-self._count // _GROUP))
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                buffers = (self._h, self._v, self._h_next, self._stencil, self._gain)
                for binding, buffer in enumerate(buffers):
                    buffer.bind_to_storage_buffer(binding)
                self._update.run(-(-self._n // _GROUP), self._n, 6)
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                self._h, self._h_next = self._h_next, self._h
            ctx.finish()


class SparseLeapfrog:
    """Leapfrog with a matrix in CSR, in float32."""

    def __init__(self, operator: WaveOperator) -> None:
        self._shape = operator.mass.shape
        self._matrix = (
            (diags_array(-1 / operator.mass.ravel()) @ stiffness_matrix(operator.stencil))
            .tocsr()
            .astype(np.float32)
        )
        self._h, self._v = np.zeros((2, operator.mass.size), np.float32)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        self._h[:] = height.ravel()

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        return self._h.reshape(self._shape).copy(), self._v.reshape(self._shape).copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            self._v += np.float32(dt) * (self._matrix @ self._h)
            self._h += np.float32(dt) * self._v


def rates(resolution: int) -> tuple[list[str], list[str]]:
    """Rows of the two tables: on the processor, and in OpenGL."""
    operator = build_operator(sphere_atlas(1.0, resolution), Material(), "fem")
    texels = operator.mass.size
    contestants: dict[str, Advance] = {
        "cpu": backend_advance("cpu", operator),
        "naive": NaiveLoop(operator).advance,
        "prange": NaiveLoop(operator, parallel=True).advance,
        "scipy": SparseLeapfrog(operator).advance,
        "stream": memory_stream(memory_fields(texels), texels, 1),
    }
    try:
        contestants |= {
            "gl": backend_advance("gl", operator),
            "plain": PlainShader(operator).advance,
        }
    except GLError as error:
        print(error)
    seconds = race(contestants)

    def rate(name: str) -> str:
        return f"{texels / np.median(seconds[name]) / 1e6:,.0f}" if name in seconds else ""

    def over(name: str, rival: str) -> str:
        return f"{np.median(seconds[rival] / seconds[name]):.2f}" if name in seconds else ""

    ratios = [over("cpu", name) for name in ("naive", "prange", "scipy", "stream")]
    processor = [
        f"{resolution}",
        rate("cpu"),
        *ratios,
        *map(rate, ("naive", "prange", "scipy", "stream")),
    ]
    return processor, [f"{resolution}", over("gl", "plain"), rate("gl"), rate("plain")]


def main() -> None:
    parser = argparse.ArgumentParser(
        description="The wave step against loops that one would write oneself."
    )
    parser.add_argument("--resolutions", default="128,256,512")
    processor, opengl = zip(
        *(rates(int(n)) for n in parser.parse_args().resolutions.split(",")), strict=True
    )
    names = ["naive loop", "prange", "scipy", "memory, one thread"]
    print(table(["N", "ripple-sim", *(f"over {name}" for name in names), *names], processor))
    print("\n" + table(["N", "over plain shader", "ripple-sim, OpenGL", "plain shader"], opengl))


if __name__ == "__main__":
    main()
