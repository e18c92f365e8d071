from .render import (
    PYTHON as PYTHON,
    blender_settings as blender_settings,
    check_cycles as check_cycles,
    frames_of_cycles as frames_of_cycles,
    python_with_bpy as python_with_bpy,
    render_cycles as render_cycles,
)
