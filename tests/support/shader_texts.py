"""A plugin of pytest: every shader text that a test compiles is kept as a file, for a validator.

`python -m pytest -p shader_texts` with `RIPPLE_SIM_SHADER_TEXTS` naming the folder; see `make
test-drivers`.
"""

import hashlib
import os
from pathlib import Path
from typing import Any

import moderngl

# Endings by which glslangValidator knows the stage, by moderngl's argument.
ENDINGS = {"vertex_shader": "vert", "fragment_shader": "frag", "geometry_shader": "geom"}


def keep(text: str, ending: str) -> None:
    folder = Path(os.environ["RIPPLE_SIM_SHADER_TEXTS"])
    folder.mkdir(parents=True, exist_ok=True)
    name = hashlib.sha256(text.encode()).hexdigest()[:16]
    (folder / f"{name}.{ending}").write_text(text)


def pytest_configure() -> None:
    compile_program = moderngl.Context.program
    compile_compute = moderngl.Context.compute_shader

    def program(self: moderngl.Context, **sources: Any) -> moderngl.Program:
        for stage, ending in ENDINGS.items():
            if sources.get(stage):
                keep(sources[stage], ending)
        return compile_program(self, **sources)

    def compute_shader(self: moderngl.Context, source: str) -> moderngl.ComputeShader:
        keep(source, "comp")
        return compile_compute(self, source)

    moderngl.Context.program = program
    moderngl.Context.compute_shader = compute_shader
