"""The sphere map: a closed mesh of genus 0 mapped one-to-one onto the unit sphere, its area spread evenly."""

from .certificate import Certificate, certify, solid_angles, stretch, stretch_quantiles
from .conformal import conformal_sphere_map
from .progressive import progressive_sphere_map

__all__ = [
    "Certificate",
    "certify",
    "conformal_sphere_map",
    "progressive_sphere_map",
    "solid_angles",
    "stretch",
    "stretch_quantiles",
]
