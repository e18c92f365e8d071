"""Interactive viewer: `Session` runs a scene without a window, `Window` shows it with PyVista.

A PyVista plotter makes other OpenGL contexts of its process unusable, so a window needs a process of its own,
such as `ripple-sim view`, where the waves are solved on the CPU.
"""
