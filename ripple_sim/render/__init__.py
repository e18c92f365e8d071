"""Offscreen renderer: a MuJoCo model and its rippled targets, drawn headless into RGB frames."""

from .camera import Camera, FixedCamera
from .renderer import Renderer
from .surfaces.surface import Surface
from .visuals.lights import LIGHTING
from .visuals.visual import LOOKS

__all__ = ["LIGHTING", "LOOKS", "Camera", "FixedCamera", "Renderer", "Surface"]
