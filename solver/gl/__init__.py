"""OpenGL: the one context of the process, its shaders and fences."""

from .context import GLContext, select_device, shared_context
from .drivers import is_software
from .shader import load_shader

__all__ = ["GLContext", "is_software", "load_shader", "select_device", "shared_context"]
