"""OpenGL: the one context of the process, its shaders and fences."""

from .context import GLContext, load_shader, select_device, shared_context

__all__ = ["GLContext", "load_shader", "select_device", "shared_context"]
