"""Small texel meshes made by hand, whose waves are known."""

import numpy as np
from scipy.sparse import diags_array
from scipy.sparse.linalg import eigsh

from ripple_sim.solver import TexelMesh, TexelTopology, glue

RIM = (-1, -1)
INNER = slice(1, -1)  # a chart's own texels within its halo
# of each side, south, east, north and west: the halo's places beyond it, and the texels beside it
SIDES = (
    ((0, INNER), (1, INNER)),
    ((INNER, -1), (INNER, -2)),
    ((-1, INNER), (-2, INNER)),
    ((INNER, 0), (INNER, 1)),
)
CORNERS = ((0, 0), (0, -1), (-1, -1), (-1, 0))  # halo places beyond the corners of a chart


def _corners_to_places(corners: np.ndarray, topology: TexelTopology) -> np.ndarray:
    """Positions with halo of flat charts with the given corners [C, 4, 3].

    Beyond a rim lies the point of the rim that is nearest to the texel: there the waves' natural
    boundary is exact.
    """
    places = _bilinear(corners, topology.shape[1])
    for side, (rim, texel) in enumerate(SIDES):
        start = corners[:, side]
        end = corners[:, (side + 1) % 4]
        places[:, *rim] = _nearest_on_lines(places[:, *texel], start, end)
    texels = places[:, INNER, INNER].reshape(-1, 3)
    copied = ~topology.own & ~topology.rim & (topology.halo >= 0)
    places[copied] = texels[topology.halo[copied]]
    for chart, corner in np.argwhere(topology.valence == 0):
        _place_beyond_corner(places, topology, chart, CORNERS[corner])
    return places


def _bilinear(corners: np.ndarray, n: int) -> np.ndarray:
    """Texel centres between corners [C, 4, 3], with the rim beyond them, [C, n + 2, n + 2, 3]."""
    along_side = ((np.arange(n + 2) - 0.5) / n).clip(0, 1)
    s = along_side[None, None, :, None]
    t = along_side[None, :, None, None]
    a, b, c, d = (corners[:, k, None, None] for k in range(4))
    return (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d


def _nearest_on_lines(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Nearest points of lines from start to end [C, 3] to points [C, k, 3]."""
    along = end - start
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    distance = np.einsum("cij,cj->ci", points - start[:, None], along)
    return start[:, None] + distance[..., None] * along[:, None]


def _place_beyond_corner(
    places: np.ndarray, topology: TexelTopology, chart: int, corner: tuple[int, int]
) -> None:
    """Beyond a rim and a glued side lies the rim's point beside the neighbour's corner texel."""
    n = topology.shape[1]
    row, column = corner
    other, r, c = np.unravel_index(topology.halo[chart, row, column], topology.shape)
    if not topology.rim[chart, row, column] or other == chart:
        return
    beyond_row = 0 if r == 0 else n + 1
    beyond_column = 0 if c == 0 else n + 1
    if topology.rim[other, beyond_row, c + 1]:
        places[chart, row, column] = places[other, beyond_row, c + 1]
    else:
        places[chart, row, column] = places[other, r + 1, beyond_column]


def flat_charts(corners, glued, n: int) -> TexelMesh:
    """Flat charts by their corners [C, 4, 3], counter-clockwise; texels at cell centres."""
    topology = glue(np.array(glued), n)
    places = _corners_to_places(np.asarray(corners, dtype=np.float64), topology)
    return TexelMesh.of(topology, places[:, 1:-1, 1:-1], beyond=places)


def square(n: int) -> TexelMesh:
    """Unit square with free edges: one chart."""
    return flat_charts([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], [[RIM] * 4], n)


def aslant(n: int, slope: float) -> TexelMesh:
    """Unit square with free edges whose grid lines are bent, and end at the edges at an angle."""
    place = ((np.arange(n + 2) - 0.5) / n).clip(0, 1)
    u, v = np.meshgrid(place, place)
    x = u + slope * np.sin(np.pi * u) * (v - 0.5)
    y = v + 0.7 * slope * np.sin(np.pi * v) * (u - 0.5)
    places = np.stack([x, y, 0 * x], axis=-1)[None]
    return TexelMesh.of(glue(np.array([[RIM] * 4]), n), places[:, 1:-1, 1:-1], beyond=places)


def polygon(sides: int, n: int) -> TexelMesh:
    """Regular polygon with free edges, cut from its centre into a chart for each corner."""
    angle = 2 * np.pi * np.arange(sides) / sides
    tips = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    middles = (tips + np.roll(tips, -1, axis=0)) / 2
    centre = np.zeros_like(tips)
    corners = np.stack(
        [centre, middles, np.roll(tips, -1, axis=0), np.roll(middles, -1, axis=0)], axis=1
    )
    glued = [[((i - 1) % sides, 3), RIM, RIM, ((i + 1) % sides, 0)] for i in range(sides)]
    return flat_charts(corners, glued, n)


def disk(n: int) -> TexelMesh:
    """Unit disk with a free edge: a square of one chart in the middle, and four charts round it."""
    inner = 0.45 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    t = (np.arange(n) + 0.5) / n
    u, v = np.meshgrid(t, t)
    charts = [np.stack([0.9 * u - 0.45, 0.9 * v - 0.45], axis=-1)]
    for side in range(4):
        first = inner[(side + 1) % 4]
        last = inner[side]
        angle = (side * 0.5 - 0.25 - 0.5 * u) * np.pi
        rim = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        charts.append(
            (1 - v[..., None]) * (first + u[..., None] * (last - first)) + v[..., None] * rim
        )
    glued = [[(side + 1, 0) for side in range(4)]]
    glued += [
        [(0, side), ((side - 1) % 4 + 1, 3), RIM, ((side + 1) % 4 + 1, 1)] for side in range(4)
    ]
    topology = glue(np.array(glued), n)
    flat = np.stack(charts)
    positions = np.concatenate([flat, np.zeros_like(flat[..., :1])], axis=-1)
    places = topology.with_halo(positions)
    places[topology.halo < 0] = np.nan
    places[topology.rim] /= np.linalg.norm(places[topology.rim], axis=-1, keepdims=True)
    return TexelMesh.of(topology, positions, beyond=places)


def flat_torus(n: int) -> TexelMesh:
    """Unit square whose opposite sides are one: a chart that is glued to itself."""
    topology = glue(np.array([[(0, 2), (0, 3), (0, 0), (0, 1)]]), n)
    place = (np.arange(n + 2) - 0.5) / n
    x, y = np.meshgrid(place, place)
    places = np.stack([x, y, 0 * x], axis=-1)[None]
    return TexelMesh.of(topology, places[:, 1:-1, 1:-1], beyond=places)


def two_squares(n: int) -> TexelMesh:
    """Two unit squares, one above the other, without links between them."""
    lower = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return flat_charts([lower, lower + np.array([0, 0, 1])], [[RIM] * 4] * 2, n)


def eigenvalues(texels: TexelMesh, count: int) -> np.ndarray:
    """Least squared angular frequencies at wave speed 1."""
    mass = diags_array(texels.areas.ravel())
    start = np.random.default_rng(0).standard_normal(mass.shape[0])
    # four more than asked for, to full precision: only round-off shows the second of two equal
    # eigenvalues
    found = eigsh(
        texels.stiffness(), count + 4, mass.tocsc(), sigma=-0.1, v0=start, return_eigenvectors=False
    )
    return np.sort(found)[:count]


def square_eigenvalues(rim: str) -> np.ndarray:
    """The lowest eigenvalues of the unit square at wave speed 1, in ascending order."""
    first = 1 if rim == "fixed" else 0
    return np.sort([np.pi**2 * (a * a + b * b) for a in range(first, 9) for b in range(first, 9)])
