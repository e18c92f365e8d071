"""The report of `ripple-sim info`: versions, OpenGL driver, wave solver; and what to install to render."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import os
import platform

from ripple_sim.diagnostics import find_problems
from ripple_sim.solver.backends.backend import auto_backend, measured
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import shared_context

PACKAGES = (
    "ripple-sim",
    "mujoco",
    "numpy",
    "scipy",
    "numba",
    "libigl",
    "trimesh",
    "embreex",
    "moderngl",
    "av",
    "pyvista",
)


@dataclasses.dataclass(frozen=True)
class OpenGL:
    """The driver that renders, in its own words."""

    renderer: str
    vendor: str
    version: str
    software: bool


@dataclasses.dataclass(frozen=True)
class Info:
    """What `ripple-sim info` reports.

    Attributes
    ----------
    versions : dict
        Version of ripple-sim, Python and each main dependency; None if it is not installed.
    system : str
        Operating system and architecture.
    processors : int
    opengl : OpenGL or None
        None if there is no usable context; `advice` then says what to install.
    backend : str
        The wave solver of "auto": "gl" or "cpu".
    measured : str
        What was measured to choose it, once on this machine; "" where nothing was.
    advice : str
        Problems that prevent or slow down rendering, with their fixes, one per line; "" if there is none.
    """

    versions: dict[str, str | None]
    system: str
    processors: int
    opengl: OpenGL | None
    backend: str
    measured: str
    advice: str


def collect() -> Info:
    """Examine this machine; a lack of OpenGL is reported, not raised."""
    opengl, failure = None, ""
    try:
        context = shared_context()
    except GLError as error:
        failure = str(error)
    else:
        opengl = OpenGL(context.renderer, context.vendor, context.version, context.software)
    findings = find_problems(opengl.software if opengl else None)
    return Info(
        versions={"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}},
        system=platform.platform(),
        processors=os.cpu_count() or 1,
        opengl=opengl,
        backend=auto_backend(),
        measured=str(measured(context)) if opengl and not opengl.software else "",
        advice="\n".join(map(str, findings)) or failure,
    )


def as_text(info: Info) -> str:
    """Format the report as text."""
    gl = info.opengl
    where = "on the CPU" if info.backend == "cpu" else "on the GPU, in OpenGL compute shaders"
    rows = {
        **{name: version or "not installed" for name, version in info.versions.items()},
        "system": f"{info.system}, {info.processors} processors",
        "OpenGL": f"{gl.version}, {gl.vendor}" if gl else "none",
        "renderer": f"{gl.renderer} ({'software' if gl.software else 'hardware'})"
        if gl
        else "none: rendering is impossible",
        "waves": f"{info.backend} (auto: {where})",
        **({"measured": f"nine substeps: {info.measured}"} if info.measured else {}),
    }
    width = max(map(len, rows))
    lines = [f"{name:<{width}}  {value}" for name, value in rows.items()]
    return "\n".join([*lines, *(["", info.advice] if info.advice else [])])


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
