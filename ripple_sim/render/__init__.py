"""Offscreen renderer: a MuJoCo model and its rippled targets, drawn headless into RGB frames."""

from .camera import Camera, FixedCamera
from .looks import LOOKS
from .renderer import LIGHTING, Renderer
from .surface import Surface

__all__ = ["LIGHTING", "LOOKS", "Camera", "FixedCamera", "Renderer", "Surface"]
