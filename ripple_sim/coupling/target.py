"""`Target`: what ripples in a model, and how."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material
from ripple_sim.solver.errors import deprecated, shown
from ripple_sim.solver.operator.plate_rim import Rim

from .geoms import ByGeom, GeomKey, Value, by_name, find_target

# Version in which keyword arguments of `Ripples` no longer take mappings by geom.
_MAPPINGS_END = "2.0"

# A value for all targets. A mapping of values by geom is deprecated: `Target` takes its place.
ForTargets: TypeAlias = Value | ByGeom[Value]

# Fields that have no meaning for some targets: only hits with Hertz's pulse have a modulus.
_OPTIONAL_FIELDS = ("modulus",)


@dataclasses.dataclass(frozen=True)
class Target:
    """A geom, flex or skin that ripples: its material, and how its waves are solved.

    `Ripples(model, {"egg": Target(material, resolution=96)})` takes it beside a bare `Material`.
    A field that is None takes the value of the keyword argument of the same name.

    Attributes
    ----------
    material : Material
        Unset coefficients are chosen by the model, see `suited_material`.
    resolution : int, optional
        Texels along an edge of the atlas's charts.
    layout : str, optional
        How the surface gets its charts: "auto", "cube" or "patches"; see `build_atlas`.
    rim : str or callable, optional
        What the rims of an open surface do; see `WaveSolver`.
    high_pass : bool, optional
        Whether a flex keeps to itself the coarse motion that contacts give it; see `Ripples`.
    pulse : str, optional
        How long a hit takes: "contact" or "hertz"; see `Ripples`.
    modulus : float, optional
        For "hertz": E* of the two materials [Pa].
    contacts : sequence of str or int, optional
        The geoms that collide for a target that is only visible. They are on its body or on bodies
        welded to it. A target that neither collides nor names geoms takes the contacts of all geoms
        of its body that collide and do not ripple. A contact loads the nearest part of the surface
        that faces it; if several targets share a geom, the nearest target.
    limit : bool
        Whether to warn of waves that are too high or too steep for the object.
    conserve_volume : bool, optional
        Whether the mean of every push is taken out; see `WaveSolver`.
    """

    material: Material = dataclasses.field(default_factory=Material)
    resolution: int | None = None
    layout: str | None = None
    rim: Rim | None = None
    high_pass: bool | None = None
    pulse: str | None = None
    modulus: float | None = None
    contacts: Sequence[GeomKey] | None = None
    limit: bool = True
    conserve_volume: bool | None = None


def named_targets(
    model: mujoco.MjModel,
    materials: ByGeom[Material | Target] | ByGeom[Material] | ByGeom[Target],
    common: Mapping[str, Any],
) -> dict[str, Target]:
    """Targets by name, with fields that they leave open filled in.

    The values are those of the arguments that are common to all targets.

    Parameters
    ----------
    model : mujoco.MjModel
    materials : mapping
        Geom to its `Material` or `Target`.
    common : mapping
        Field of `Target` to a value for all targets, or, which is deprecated, to a mapping of
        values by geom.

    Raises
    ------
    SceneError
        For an unknown geom, one that cannot ripple, one that is given twice or that a mapping
        leaves out, and for a value that is neither a `Material` nor a `Target`.
    """
    if not isinstance(materials, Mapping):
        raise SceneError(
            "materials must be a mapping of geom names to Material or Target, got "
            f"{type(materials).__name__}"
        )
    for key, value in materials.items():
        find_target(model, key)
        if not isinstance(value, (Material, Target)):
            raise SceneError(
                f"material of geom {key!r} must be a Material or a Target, got {shown(value)}"
            )
    targets = {}
    for name, value in by_name(model, materials, "materials").items():
        targets[name] = value if isinstance(value, Target) else Target(value)
    for field, value in common.items():
        values = _value_for_each(model, targets, field, value)
        for name, target in targets.items():
            if getattr(target, field) is None:
                changes: dict[str, Any] = {field: values.get(name)}
                targets[name] = dataclasses.replace(target, **changes)
    return targets


def _value_for_each(
    model: mujoco.MjModel, targets: Iterable[str], field: str, value: ForTargets[Value]
) -> dict[str, Value]:
    """The value of a field for each target.

    A mapping may leave out targets for which the field has no meaning.
    """
    if not isinstance(value, Mapping):
        return dict.fromkeys(targets, value)
    deprecated(
        f"{field} as a mapping by geom",
        f"Target(material, {field}=...) for each geom",
        _MAPPINGS_END,
    )
    values = by_name(model, value, field)
    missing = [name for name in targets if name not in values]
    if missing and field not in _OPTIONAL_FIELDS:
        raise SceneError(
            f"{field} has no entry for geom {missing[0]!r}; it has "
            f"{', '.join(map(repr, values)) or 'none'}: give every rippling geom one, or one "
            f"{field} for all"
        )
    return values


def contacts_of(targets: Mapping[str, Target], contacts: Any) -> ByGeom[Sequence[GeomKey]]:
    """The geoms that collide for targets, as the targets name them.

    A mapping of them as an argument is deprecated.
    """
    if contacts is None:
        contacts = {}
    elif isinstance(contacts, Mapping):
        deprecated(
            "contacts as an argument",
            "Target(material, contacts=[...]) for each geom",
            _MAPPINGS_END,
        )
    else:
        return contacts  # `named_collision_geoms` refuses it
    geoms_by_target = dict(contacts)
    for name, target in targets.items():
        if target.contacts is not None:
            geoms_by_target[name] = target.contacts
    return geoms_by_target
