"""Make an OpenGL context; print the renderer's name and the number of llvmpipe's threads."""

from pathlib import Path

from ripple_sim.solver.gl import shared_context

print(shared_context().renderer)
names = [file.read_text() for file in Path("/proc/self/task").glob("*/comm")]
print(sum(name.startswith("llvmpipe-") for name in names))
