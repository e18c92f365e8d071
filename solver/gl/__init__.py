"""OpenGL: the one context of the process, its shaders and fences."""

from .context import GLContext
from .drivers import is_software
from .shader import load_shader
from .shared import select_device, shared_context

__all__ = ["GLContext", "is_software", "load_shader", "select_device", "shared_context"]
