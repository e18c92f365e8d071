"""Interactive viewer: `Session` runs a scene and knows nothing of windows, `Window` shows it with PyVista.

A PyVista plotter makes other OpenGL contexts of its process unusable, so a window belongs into a process of its own,
which `ripple-sim view` is; the waves are solved on the CPU there.
"""
