"""OpenGL: the one context of the process, its shaders and fences."""

from .context import GLContext, is_software, load_shader, select_device, shared_context

__all__ = ["GLContext", "is_software", "load_shader", "select_device", "shared_context"]
