"""Warnings of targets that contacts do not meet, or whose waves are too high.

Contacts do not meet a target if nothing can touch it, or if it collides off the surface that
ripples. Waves are too high or too steep for their object by comparison of heights with the local
radius and of slopes with 1; each target is warned of once, with a material that would do.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping

import igl
import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Material, WaveSolver
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.texels.thickness import half_thickness

from .geoms import TARGET_TYPES
from .model import CoupledModel, flex_thickness
from .suited import Extent, bearing_density
from .target_mesh import mesh_arrays, primitive_triangles

_GEOM = mujoco.mjtGeom
# Points of the rippling surface at which its distance is taken.
_POINTS = 1500

# A collision surface off the true one by this share of the target's size shows: bodies stop in
# mid-air. The coarse tolerance is for geoms that were made to collide in place of a finer one.
GAP_TOLERANCE = 0.02
COARSE_TOLERANCE = 0.1

# The height allowed over the local radius.
HIGH = 0.25

# Of the surface, what is counted as the thinnest part is beyond this share.
_THINNEST = 0.99
_ROWS = 4

# Slopes beyond 1 are reported if more than this share of the surface has them: a pit under a hard
# body is steep, but small.
_STEEP_AREA = 0.01

# The crests of all steps, and the slopes of one, are looked at once in so many steps. They are read
# back from a GPU for that, which lets it run dry.
_EVERY = {"cpu": 16, "gl": 128}

# A wave that is too high is followed for so many looks, or until it falls again, so that the advice
# is based on its crest.
_FOLLOWED = 4

# The density that is advised is this much more than the least for what was seen, and for a wave of
# this share of its height that has spread to where the object is thinnest.
_MARGIN = 2.0
_SPREAD = 0.3

# What a material is printed with; the others change no wave.
_PRINTED = tuple(
    each for each in dataclasses.fields(Material) if isinstance(each.default, float | bool)
)


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m].

    It is measured at points of the hull that are 1/24 of its size apart.
    """
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(
        hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24
    )
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def collision_gap(coupled: CoupledModel, target: int, atlas: Atlas, geoms: Iterable[int]) -> float:
    """Distance of a target's surface from the geoms that collide for it [m].

    It is how deep bodies sink into the surface before they meet these geoms, or how far above the
    surface they are held, whichever is more. The latter is the median over the surface, since a
    part of it may well lie inside a geom that collides for the target's neighbour too.

    Parameters
    ----------
    coupled : CoupledModel
    target : int
        Geom id.
    atlas : Atlas
        Of the target.
    geoms : iterable of int
        Ids of geoms on its body or on bodies welded to it. Planes and height fields have no surface
        to be off from.
    """
    model = coupled.model
    data = mujoco.MjData(coupled.model)
    mujoco.mj_kinematics(model, data)
    points = atlas.positions.reshape(-1, 3)
    points = points[:: -(-len(points) // _POINTS)]
    points = data.geom_xpos[target] + points @ data.geom_xmat[target].reshape(3, 3).T
    solids = [
        geom for geom in geoms if TARGET_TYPES.get(int(model.geom_type[geom]), "hfield") != "hfield"
    ]
    if not solids:
        return 0.0
    outside = np.full(len(points), np.inf)
    for geom in solids:
        kind = TARGET_TYPES[int(model.geom_type[geom])]
        if kind in ("mesh", "sdf"):
            V, F, _ = mesh_arrays(model, int(model.geom_dataid[geom]))
        else:
            V, F = primitive_triangles(kind, model.geom_size[geom])
        if kind == "mesh" and not coupled.has_flex[geom]:
            hull = trimesh.convex.convex_hull(V)
            V = np.array(hull.vertices)
            F = np.array(hull.faces)
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        outside = np.minimum(outside, igl.signed_distance(local, V, F)[0])
    return float(max(outside.max(), -np.median(outside)))


def collision_warnings(coupled: CoupledModel, geom: int, atlas: Atlas) -> Iterator[str]:
    """Warnings of contacts that a target gets wrongly, or not at all.

    Nothing can touch it, it collides off its surface, or MuJoCo tells no forces of its contacts.
    """
    model = coupled.model
    name = coupled.names[geom]
    size = float(np.ptp(atlas.mesh.V, axis=0).max())
    solids = coupled.collision_geoms(geom)
    if coupled.out_of_touch(geom):
        yield _touch_warning(coupled, geom)
    elif geom in coupled.convex_colliders or any(each != geom for each in solids):
        colliders = [part for each in solids for part in coupled.convex_colliders.get(each, [each])]
        gap = collision_gap(coupled, geom, atlas, colliders)
        if gap > COARSE_TOLERANCE * size:
            names = ", ".join(repr(coupled.names[each]) for each in colliders)
            yield (
                f"geom {name!r} collides as {names}, up to {gap:.3g} m ({gap / size:.0%} of its "
                "size) off the surface that ripples: contacts load it where it is nearest to them; "
                f"name other geoms in Target(contacts=...) or call make_collidable(spec, {name!r})"
            )
    elif coupled.has_flex[geom]:
        yield from _flex_warning(coupled, geom)
    elif model.geom_type[geom] == _GEOM.mjGEOM_MESH and (
        model.geom_contype[geom] or model.geom_conaffinity[geom]
    ):
        gap = hull_gap(atlas)
        if gap > GAP_TOLERANCE * size:
            yield (
                f"geom {name!r} collides as its convex hull, up to {gap:.3g} m ({gap / size:.0%} "
                'of its size) off the surface that ripples; give it type="sdf" in the MJCF, or '
                f"call make_collidable(spec, {name!r})"
            )
    elif model.geom_type[geom] == _GEOM.mjGEOM_SDF:
        hills = np.flatnonzero(coupled.can_collide(geom) & (model.geom_type == _GEOM.mjGEOM_HFIELD))
        if len(hills):
            names = ", ".join(repr(coupled.names[other]) for other in hills)
            yield (
                f"MuJoCo finds no contacts of the SDF geom {name!r} with height fields ({names}): "
                f'call make_collidable(spec, {name!r}, "flex"), or choose contype and conaffinity '
                "so that they do not meet"
            )
    # not in MuJoCo's older versions
    passive = getattr(model, "flex_passive", np.zeros(model.nflex))
    for flex in coupled.soft_flexes(geom).tolist():
        if passive[flex]:
            yield (
                f"MuJoCo tells no forces of the passive contacts of flex "
                f"{coupled.names[model.ngeom + flex]!r}, under "
                f'which geom {name!r} will not ripple; set passive="false" in the flex\'s <contact>'
            )


def _touch_warning(coupled: CoupledModel, geom: int) -> str:
    """Warning of a target that nothing can touch."""
    model = coupled.model
    name = coupled.names[geom]
    colliders = coupled.collision_geoms(geom)
    if not colliders:
        return (
            f"nothing can touch geom {name!r}: it does not collide (contype and conaffinity are "
            "0), nor does another geom of its body; name the geoms that collide for it, "
            "Target(contacts=[...]), or give it a contype"
        )
    masks = ", ".join(
        (
            f"{coupled.names[each]!r} has contype {model.geom_contype[each]} and conaffinity "
            f"{model.geom_conaffinity[each]}"
        )
        for each in colliders
    )
    return (
        f"nothing can touch geom {name!r}: {masks}, which match no geom of a body that is not "
        "welded to its own"
    )


def _flex_warning(coupled: CoupledModel, geom: int) -> Iterator[str]:
    """Warning of geoms that a flex collider meets badly, or not at all."""
    model = coupled.model
    name = coupled.names[geom]
    meets = coupled.can_collide(geom)
    thickness = flex_thickness(model, coupled.flex_colliders[geom])
    boxes = model.geom_type == _GEOM.mjGEOM_BOX
    distances = model.geom_type == _GEOM.mjGEOM_SDF
    # MuJoCo lets bodies pass through one another that are joined, or excluded by name
    body = int(model.geom_bodyid[geom])
    weld = model.body_weldid
    above = weld[model.body_parentid[weld]]
    joined = (
        (weld != weld[body])
        & (weld != 0)
        & ((above == weld[body]) | (above[body] == weld))
        & bool(weld[body])
    )
    joined &= not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    excluded = np.column_stack([model.exclude_signature >> 16, model.exclude_signature & 0xFFFF])
    joined[excluded[(excluded == body).any(axis=1)]] = True
    apart = joined[model.geom_bodyid] & (model.geom_bodyid != body)
    reasons = (
        (
            boxes,
            (
                "MuJoCo may throw boxes ({}) aside, with impulses off by a tenth, though not "
                "box-shaped meshes"
            ),
        ),
        (distances, f"SDF geoms ({{}}) sink {thickness:.2g} m into it before they are pushed out"),
        (
            apart,
            (
                "MuJoCo finds no contacts of a flex with bodies that are joined to its own or "
                "excluded ({})"
            ),
        ),
    )
    named = [
        ([repr(coupled.names[i]) for i in np.flatnonzero(which & meets)], why)
        for which, why in reasons
    ]
    found = [why.format(", ".join(names)) for names, why in named if names]
    if found:
        yield (
            f"geom {name!r} collides through a flex: {'; '.join(found)}; call "
            f'make_collidable(spec, {name!r}, "sdf"), or choose contype and conaffinity so that '
            "they do not meet"
        )


def scales_of(atlas: Atlas) -> tuple[Floats32, float, float]:
    """What the heights on an atlas are compared with.

    Returns
    -------
    fields : float32 [4, C, n, n]
        1 over the greatest height allowed [1/m]; 1 over the distance to the next texel in the next
        row and column [1/m], 0 beyond the chart; share of the surface's area.
    per_thinnest : float
        1 over the greatest height allowed where the object is thinnest [1/m].
    calm : float
        Waves that are no higher are neither too high nor too steep anywhere [m].
    """
    fields = np.zeros((4, *atlas.areas.shape))
    fields[0] = 1 / (HIGH * half_thickness(atlas))
    for axis in (1, 2):
        spacing = np.linalg.norm(np.diff(atlas.positions, axis=axis), axis=-1)
        inner = (slice(None),) * axis + (slice(None, -1),)
        # needles, on which a slope means little
        fields[axis][inner] = 1 / np.maximum(spacing, 0.5 * np.median(spacing))
    fields[3] = atlas.areas / atlas.areas.sum()
    thinnest = float(np.quantile(fields[0], _THINNEST))
    # no slope can reach 1 where neighbours differ by twice this height at most
    calm = min(1 / fields[0].max(), 1 / (8**0.5 * fields[1:3].max()))
    return fields.astype(np.float32), thinnest, float(calm)


def steep_area(height: Floats32, per_row: Floats32, per_column: Floats32, share: Floats32) -> float:
    """Share of the surface that is steeper than 1, seen on every fourth row."""
    here = np.s_[:, :-1:_ROWS, :-1]
    below = np.s_[:, 1::_ROWS, :-1]
    beside = np.s_[:, :-1:_ROWS, 1:]
    down = (height[below] - height[here]) * per_row[here]
    right = (height[beside] - height[here]) * per_column[here]
    seen = share[here].astype(np.float64)
    return float(seen[down**2 + right**2 > 1].sum() / seen.sum())


class AmplitudeCheck:
    """Warns of waves that are too high or too steep.

    Heights are compared with the local radius (`half_thickness`), slopes with 1.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping of int to WaveSolver
        By geom; see `waves_changed`.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled = coupled
        self._watched = {geom: _WatchedTarget(each) for geom, each in waves.items()}
        self._steps = 0

    def __call__(self) -> None:
        """Look at the heights, if it is time to. Call it after each step of the waves."""
        for geom, watch in list(self._watched.items()):
            if self._steps % _EVERY[watch.waves.backend] == 0 and watch.look():
                self._warn(geom)
        self._steps += 1

    def ignore(self, geom: int) -> None:
        """Give no warning of a geom."""
        self._watched.pop(geom, None)

    def watches(self, geom: int) -> bool:
        """Whether a geom may still be warned of."""
        return geom in self._watched

    def waves_changed(self, geom: int, waves: WaveSolver) -> None:
        """Go on with the new waves of a geom."""
        if geom in self._watched:
            watch = self._watched[geom]
            watch.look()  # at the old ones, a last time
            watch.waves = waves
            waves.crests()

    def flush(self) -> None:
        """Look at the heights a last time, and warn of what was seen: the waves will end."""
        for geom, watch in list(self._watched.items()):
            watch.look()
            if watch.excess > 1:
                self._warn(geom)

    def _warn(self, geom: int) -> None:
        watch = self._watched.pop(geom)
        warn_caller(
            (
                f"the waves on geom {self._coupled.names[geom]!r} are {watch.what}; pictures show "
                "them limited. "
            )
            + self._advice(geom, watch.waves, _MARGIN * watch.needed)
        )

    def _advice(self, geom: int, waves: WaveSolver, factor: float) -> str:
        """A material that would do, with a density higher by at least a factor."""
        material = waves.material
        given = {each.name: getattr(material, each.name) for each in _PRINTED}
        if any(np.ndim(value) for value in given.values()):
            target = repr(self._coupled.names[geom])
            density = f"{_rounded_up(factor):g} * ripples[{target}].material.density"
            return f"This would do: ripples.change_material({target}, density={density})"
        # what was seen may be the first of many hits
        bearing = bearing_density(self._coupled, geom, Extent.of(waves.rest.mesh), material)
        given["density"] = _rounded_up(max(factor * given["density"], bearing))
        pairs = [
            (each.name, repr(float(f"{given[each.name]:.4g}")))
            for each in _PRINTED
            if given[each.name] != each.default or each.name == "density"
        ]
        python, toml = (
            ", ".join(f"{name}{sign}{value}" for name, value in pairs) for sign in ("=", " = ")
        )
        return f"This would do: Material({python}), in a scene file material = {{{toml}}}"


class _WatchedTarget:
    """The waves of one target, as far as they were looked at.

    Attributes
    ----------
    waves : WaveSolver
    excess : float
        The most, over what is allowed, of heights and slopes.
    needed : float
        By how much waves would have to be lower.
    what : str
        What was too large, how large, and where.
    """

    def __init__(self, waves: WaveSolver) -> None:
        self.waves = waves
        # lower waves are right anywhere, or too small to matter
        self._calm = 1e-3 * float(np.ptp(waves.rest.mesh.V, axis=0).max())
        self._scales: tuple[Floats32, float] | None = None
        self.excess = 0.0
        self.needed = 0.0
        self.what = ""
        self._looks = 0

    def look(self) -> bool:
        """Whether the waves are too high or too steep, and it is time to say so."""
        excess = 0.0
        crests = self.waves.crests()
        if float(crests.max()) > self._calm:
            excess = self._measure(crests, self.waves.height)
        if self.excess > 1:
            self._looks += 1
        return self.excess > 1 and (excess < self.excess or self._looks >= _FOLLOWED)

    def _measure(self, crests: NDArray[np.float32], height: NDArray[np.float32]) -> float:
        if self._scales is None:
            fields, thinnest, self._calm = scales_of(self.waves.rest)
            self._scales = fields, thinnest
        (per_limit, per_row, per_column, share), per_thinnest = self._scales
        # the greatest crest over what is allowed there
        over = (crests * per_limit).reshape(-1)
        texel = int(over.argmax())
        high = float(over[texel])
        steep_share = steep_area(height, per_row, per_column, share)
        excess = high
        what = ""
        if steep_share > _STEEP_AREA:
            down = np.diff(height, axis=1, append=0) * per_row
            slope = np.hypot(down, np.diff(height, axis=2, append=0) * per_column).ravel()
            order = np.argsort(-slope)
            # the slope that this share of the surface exceeds
            steep = float(
                slope[order[np.searchsorted(np.cumsum(share.ravel()[order]), _STEEP_AREA)]]
            )
            excess = max(excess, steep)
            what = f"too steep: a slope of {steep:.2g} or more on {steep_share:.1%} of it"
        if excess > max(self.excess, 1.0):
            if high == excess:
                where = ", ".join(
                    f"{x:.3g}" for x in self.waves.rest.positions.reshape(-1, 3)[texel]
                )
                radius = 1 / (HIGH * float(per_limit.reshape(-1)[texel]))
                here = float(crests.reshape(-1)[texel])
                what = (
                    f"too high: {here:.2g} m at ({where}) m, where the object's radius is "
                    f"{radius:.2g} m"
                )
            self.what = what
        self.excess = max(self.excess, excess)
        spread = _SPREAD * float(crests.max()) * per_thinnest
        self.needed = max(self.needed, excess, spread)
        return excess


def _rounded_up(value: float) -> float:
    """To two digits."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step - 1e-9) * step
