"""OpenGL: the one context of the process, its shaders and fences."""

from .context import GLContext, is_software, select_device, shared_context
from .shader import load_shader

__all__ = ["GLContext", "is_software", "load_shader", "select_device", "shared_context"]
