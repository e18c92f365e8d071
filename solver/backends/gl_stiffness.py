"""The stiffness of a moving surface on the GPU, made there from its vertices, in a storage buffer."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..kernel import Ints
from ..texels.cells import EVEN, LEAST_AREA, PER_HOURGLASS, PER_TINY, SHARE, TINY
from ..texels.moving import MovedStencil, Ride
from ..texels.stencil import NO_LINKS, IrregularLinks, Stencil, crossing_links, missing_links
from ..texels.stiffness import LEAST_RATIO
from ..texels.topology import TexelTopology
from .gl_dispatch import Dispatch
from .gl_fields import FieldLayout

_LAW = {
    name: float(value)
    for name, value in {
        "PER_HOURGLASS": PER_HOURGLASS,
        "SHARE": SHARE,
        "EVEN": EVEN,
        "LEAST_AREA": LEAST_AREA,
        "TINY": TINY,
        "PER_TINY": PER_TINY,
        "LEAST_RATIO": LEAST_RATIO,
    }.items()
}


class DeviceStiffness:
    """Makes stencils of one set of cells, for one coefficient, wherever the vertices are.

    The quads are the GPU's; the few other cells are worked out on the CPU, and what they give is uploaded.

    Parameters
    ----------
    gl : GLContext
    fields : FieldLayout
    dispatch : Dispatch
    stencil : MovedStencil
        One of them.
    mass : float64 [C, n, n]
        [kg].
    """

    def __init__(
        self,
        gl: GLContext,
        fields: FieldLayout,
        dispatch: Dispatch,
        stencil: MovedStencil,
        mass: NDArray[np.float64],
    ) -> None:
        self._gl, self._dispatch, self._mass = gl, dispatch, mass
        topology, cells, ride = stencil.topology, stencil.cells, stencil.places.ride.ride
        self._width, self._count = topology.halo.shape[1], topology.halo.size
        self._special: Ride = ride.of_each(cells.special_places)
        self._around = np.zeros((3, self._count))
        self._added = DeviceLinks(gl, topology, cells.special_links, np.arange(len(cells.special_links) + 1))
        crossing, missing = crossing_links(topology), missing_links(topology)
        self._copies = DeviceLinks(gl, topology, crossing.copies, crossing.begins)
        self._missing = DeviceLinks(gl, topology, missing, np.arange(len(missing) + 1))
        shares = np.where(topology.rim, 0.5, 1.0) if topology.fixed_rim else np.ones(self._count)
        pairs, quads = fields.link_addresses(), stencil.coefficient.quads
        self._laid = len(pairs)
        with gl as ctx:
            self._vertices, self._places = (
                ctx.buffer(reserve=stencil.places.V.nbytes),
                ctx.buffer(reserve=24 * self._count),
            )
            self._sides, self._links = ctx.buffer(reserve=24 * self._count), ctx.buffer(reserve=16 * self._count)
            self._values, self._peak = ctx.buffer(reserve=4 * (1 + self._added.count)), ctx.buffer(bytes(4))
        self._corners, self._weights = (
            _upload(gl, ride.corners, np.int32),
            _upload(gl, np.nan_to_num(ride.weights), np.float64),
        )
        self._conductance, self._per_area = (
            _upload(gl, each, np.float32) for each in (quads.conductance, quads.per_area)
        )
        self._pairs, self._texels = (_upload(gl, each, np.int32) for each in (pairs, topology.addresses.texels))
        self._shares, self._masses = (_upload(gl, each, np.float32) for each in (shares, mass))
        self._beside = _upload(gl, np.zeros(mass.size), np.float32)
        names = ("ride", "quad_links", "close_links", "add_links", "lay_links", "link_rates")
        self._shaders = {name: dispatch.shader(name) for name in names}
        self._shaders["quads"] = dispatch.shader("quads", **_LAW)

    @staticmethod
    def suits(stencil: Stencil) -> bool:
        """Whether a stencil can be made on the GPU: of texels that lie on their triangles, and none of them twice."""
        if not isinstance(stencil, MovedStencil):
            return False
        ride = stencil.places.ride
        return not len(ride.ride.offsets) and not len(ride.images)

    def write(self, stencil: MovedStencil, buffer: moderngl.Buffer) -> IrregularLinks | None:
        """Write the nine-point stencil into a buffer of `FieldLayout.upload_stencil`; return the irregular links."""
        V, coefficient = stencil.places.V, stencil.coefficient
        self._around[:, stencil.cells.special_places] = self._special.at(V)
        values, irregular = stencil.cells.special(self._around, coefficient)
        with self._gl:
            self._vertices.write(V.tobytes())
            self._values.write(values.astype(np.float32).tobytes() or bytes(4))
            self._run("ride", self._count, self._vertices, self._corners, self._weights, self._places)
            shape = {"width": self._width, "scale": coefficient.quads.scale, "power": coefficient.quads.power}
            self._run("quads", self._count, self._places, self._conductance, self._per_area, self._sides, **shape)
            self._run("quad_links", self._count, self._sides, self._links, width=self._width)
            for links, factor in ((self._missing, 0.0), (self._copies, 1.0)):
                self._run("close_links", links.count, self._links, links.places, links.groups, factor=factor)
            self._run("add_links", self._added.count, self._links, self._added.places, self._values)
            self._run("lay_links", self._laid, self._links, self._pairs, buffer)
            stencil.note_fastest(self._fastest(irregular))
        return irregular

    def _fastest(self, irregular: IrregularLinks | None) -> float:
        """Gershgorin's bound for what was made last."""
        links = irregular if irregular is not None else NO_LINKS
        if len(links.texels):
            beside = np.zeros(self._mass.size, np.float32)
            beside[links.texels] = np.add.reduceat(np.abs(links.weights), links.begins[:-1])
            self._beside.write(beside.tobytes())
        self._peak.write(bytes(4))
        buffers = self._links, self._peak, self._texels, self._shares, self._beside, self._masses
        self._run("link_rates", self._mass.size, *buffers, width=self._width)
        return float(np.frombuffer(self._peak.read(), np.float32)[0])

    def _run(self, name: str, count: int, *buffers: moderngl.Buffer, **uniforms: float) -> None:
        """Run a shader over a list of so many entries, if there are any."""
        if not count:
            return
        shader = self._shaders[name]
        for uniform, value in {"count": count, **uniforms}.items():
            shader[uniform] = value
        self._dispatch.bind(*buffers)
        self._dispatch.run_list(shader, count)


class DeviceLinks:
    """Groups of links, by where they lie among the links of all places.

    Attributes
    ----------
    count : int
        Groups.
    places : moderngl.Buffer
        4 times the place with halo, plus the link: east, north, north-east, or across that.
    groups : moderngl.Buffer
        First link of each, and one after its last.
    """

    def __init__(self, gl: GLContext, topology: TexelTopology, links: Ints, begins: Ints) -> None:
        charts, n, _ = topology.shape
        chart, link, r, c = np.unravel_index(links, (charts, 4, n + 1, n + 1))
        self.count = len(begins) - 1
        self.places = _upload(gl, 4 * ((chart * (n + 2) + r) * (n + 2) + c) + link, np.int32)
        self.groups = _upload(gl, np.stack([begins[:-1], begins[1:]], axis=1), np.int32)


def _upload(gl: GLContext, values: NDArray, kind: type) -> moderngl.Buffer:
    with gl as ctx:
        return ctx.buffer(np.ascontiguousarray(values, kind).tobytes() or bytes(8))


class StencilBuffer:
    """The nine-point stencil as the wave step reads it, and the irregular links.

    Attributes
    ----------
    buffer : moderngl.Buffer
    irregular : IrregularLinks or None
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, dispatch: Dispatch, stencil: Stencil) -> None:
        self._gl, self._fields, self._dispatch = gl, fields, dispatch
        self.buffer, self.irregular = fields.upload_stencil(stencil), stencil.irregular
        self._device: DeviceStiffness | None = None

    @property
    def on_device(self) -> bool:
        """Whether it has been made on the GPU."""
        return self._device is not None

    def write(self, stencil: Stencil, mass: NDArray[np.float64]) -> None:
        """Take over another stencil of the same topology: made on the GPU where that can be, else uploaded.

        A software driver's shaders run on the processor's own cores, where the CPU's loops take a fifth of the time.
        """
        if not self._gl.software and isinstance(stencil, MovedStencil) and DeviceStiffness.suits(stencil):
            if self._device is None:
                self._device = DeviceStiffness(self._gl, self._fields, self._dispatch, stencil, mass)
            self.irregular = self._device.write(stencil, self.buffer)
        else:
            self._fields.write_stencil(self.buffer, stencil)
            self.irregular = stencil.irregular
