"""A target as its scene file wants it: maps of the material, the layer over what is inside, and parts without waves."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.solver import Material, texture_map

from .scene_file import RippleEntry
from .target_maps import layer_thickness


def uniform_material(entry: RippleEntry) -> Material:
    """A target's material before its maps; one whose layer is still unknown promises nothing of wavelengths."""
    material = entry.material.material()
    return dataclasses.replace(material, wavelengths=(0.0, np.inf)) if entry.inside else material


def apply_maps(ripples: Ripples, entry: RippleEntry) -> None:
    """Give a target the coefficients that vary over it, and hold still what is to be still.

    Raises
    ------
    RippleError
        If a file cannot be read, or does not suit the target.
    """
    atlas, coefficients = ripples[entry.geom].atlas, {}
    if entry.inside:
        to_atlas = functools.partial(ripples.to_geom, entry.geom)
        thickness = layer_thickness(atlas, entry.inside, entry.thickness_limits, to_atlas)
        coefficients.update(vars(entry.material.material(thickness)))
    for name, each in entry.material.maps().items():
        coefficients[name] = texture_map(atlas, each.map, each.low, each.high, each.channel)
    if coefficients:
        ripples.change_material(entry.geom, **coefficients)
    if entry.still_map is not None:
        ripples.hold(entry.geom, 1.0 - texture_map(atlas, entry.still_map, 0.0, 1.0))
    for disc in entry.still:
        ripples.make_rigid(entry.geom, disc.point, disc.radius)
