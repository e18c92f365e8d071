"""The report of `ripple-sim info`: versions, OpenGL driver, wave solver, and advice.

It names common reasons on Linux why OpenGL does not run headless, or not on the GPU, each with its
fix. An OpenGL program without a window uses libEGL.so.1 (of libglvnd), which reads the vendor
files: small JSON files that name each driver's own EGL library. Mesa's driver then opens a render
node, /dev/dri/renderD*; NVIDIA's opens /dev/nvidia*.
"""

from __future__ import annotations

import ctypes
import importlib.metadata
import json
import os
import platform
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco

from ripple_sim import __version__
from ripple_sim.solver.backends.backend_speed import measured
from ripple_sim.solver.backends.choice import auto_backend
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import DRAWING_THREADS, shared_context

# Where libglvnd looks for vendor files.
_VENDOR_FOLDERS = ("/etc/glvnd/egl_vendor.d", "/usr/share/glvnd/egl_vendor.d")
# Libraries that OpenGL needs, and their packages on Debian and Ubuntu.
_LIBRARIES = {"libEGL.so.1": "libegl1", "libGL.so.1": "libgl1"}
# The file in which NVIDIA's driver tells its version.
_NVIDIA_VERSION = Path("/proc/driver/nvidia/version")
# Advice for containers.
_CONTAINER = "in a container, start that with NVIDIA_DRIVER_CAPABILITIES=all"

# Packages whose versions are reported.
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


def find_problems(software: bool | None, devices: Path = Path("/dev")) -> list[str]:
    """Find what keeps OpenGL off the GPU, or from running at all.

    Parameters
    ----------
    software : bool or None
        Whether OpenGL runs on the processor; None if it does not run.
    devices : Path
        Folder of the device files.

    Returns
    -------
    list of str
        Problems, each with its fix, the likeliest cause first; empty if OpenGL runs on a GPU, or
        for an unknown cause.
    """
    if software is False:
        return []
    if software is None:
        # a missing library explains the rest
        return (
            list(_library_problems()) or list(_vendor_problems()) or list(_device_problems(devices))
        )
    problems = list(_device_problems(devices))
    vendor_files, _ = _vendor_files()
    vendor_libraries = [_library_of(file) or "" for file in vendor_files]
    has_nvidia_library = any("nvidia" in library for library in vendor_libraries)
    if (devices / "nvidia0").exists() and not has_nvidia_library:
        problems.append(
            "there is an NVIDIA GPU, but no EGL vendor file of its driver, so OpenGL runs in "
            f"software: {_install_nvidia()}"
        )
    has_gpu = any(devices.glob("dri/renderD*")) or any(devices.glob("nvidia[0-9]*"))
    if problems or has_gpu:
        return problems
    return [
        f"OpenGL runs in software, on the processor: there is no GPU ({devices}/dri/renderD* or "
        f"{devices}/nvidia*): nothing to fix; rendering is faster on a machine with a GPU (in a "
        "container, pass it through with --device /dev/dri or --gpus all)"
    ]


def _library_problems() -> Iterator[str]:
    """Libraries that are missing or cannot be loaded."""
    for library, package in _LIBRARIES.items():
        try:
            ctypes.CDLL(library)
        except OSError as error:
            if "No such file" in str(error):
                yield f"the library {library} is missing: apt-get install {package}"
            else:
                yield (
                    f"the library {library} cannot be loaded ({error}): apt-get install "
                    f"--reinstall {package}"
                )


def _vendor_problems() -> Iterator[str]:
    """Vendor files that are missing, damaged, or name a library that cannot be loaded."""
    files, search_path = _vendor_files()
    if not files:
        yield (
            f"there is no EGL vendor file (*.json) in {search_path}: apt-get install libegl-mesa0 "
            "libgl1-mesa-dri; for an NVIDIA GPU install libnvidia-gl of the driver's version, "
            f"or, {_CONTAINER}"
        )
    for file in files:
        library = _library_of(file)
        if library is None:
            yield (
                f"the EGL vendor file {file} is damaged: reinstall the package it belongs to: "
                f"dpkg -S {file}"
            )
            continue
        try:
            ctypes.CDLL(library)
        except OSError:
            mesa = "apt-get install --reinstall libegl-mesa0 libgl1-mesa-dri"
            fix = _install_nvidia() if "nvidia" in library else mesa
            yield f"the EGL vendor file {file} names {library}, which cannot be loaded: {fix}"


def _device_problems(devices: Path) -> Iterator[str]:
    """Render nodes of GPUs that the user may not open."""
    nodes = sorted(devices.glob("dri/renderD*"))
    if not nodes:
        return
    import grp  # not on Windows, where there is no node either

    for node in nodes:
        if not os.access(node, os.R_OK | os.W_OK, effective_ids=True):
            number = node.stat().st_gid
            try:
                group = grp.getgrgid(number).gr_name
            except KeyError:
                group = str(number)
            yield (
                f"this user has no access to the GPU's render node {node}: sudo usermod -aG "
                f"{group} $USER, then log in again (in a container: --group-add {group})"
            )


def _install_nvidia() -> str:
    """How to install the OpenGL libraries of NVIDIA's driver."""
    version = None
    if _NVIDIA_VERSION.exists():
        version = re.search(r"\b(\d{3})\.\d+", _NVIDIA_VERSION.read_text(encoding="utf-8"))
    package = "libnvidia-gl-NNN, where NNN is the driver's version"
    if version is not None:
        package = f"libnvidia-gl-{version[1]}"
    return f"apt-get install {package}; {_CONTAINER}"


def _vendor_files() -> tuple[list[Path], str]:
    """The vendor files that libglvnd reads, and its search path."""
    names = os.environ.get("__EGL_VENDOR_LIBRARY_FILENAMES")
    if names:
        return [Path(name) for name in names.split(":")], f"__EGL_VENDOR_LIBRARY_FILENAMES={names}"
    user_folders = os.environ.get("__EGL_VENDOR_LIBRARY_DIRS")
    folders = user_folders.split(":") if user_folders else list(_VENDOR_FOLDERS)
    files: list[Path] = []
    for folder in folders:
        files += Path(folder).glob("*.json")
    return sorted(files), " or ".join(folders)


def _library_of(file: Path) -> str | None:
    """Library named in a vendor file; None if it cannot be read."""
    try:
        return str(json.loads(file.read_text(encoding="utf-8"))["ICD"]["library_path"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def find_drawing_threads(renderer: str) -> list[str]:
    """The problem of llvmpipe with drawing threads, if the user has turned them on.

    `renderer` is OpenGL's GL_RENDERER.
    """
    threads = os.environ.get(DRAWING_THREADS, "0")
    if "llvmpipe" not in renderer.lower() or threads == "0":
        return []
    return [
        f"{DRAWING_THREADS}={threads} has llvmpipe draw in threads, which may write into freed "
        f"memory and so end the program: unset {DRAWING_THREADS}, or set it to 0"
    ]


def collect() -> dict[str, Any]:
    """Examine this machine; a lack of OpenGL is reported, not raised.

    Returns
    -------
    versions : dict
        Version of ripple-sim, Python and each main dependency; None if it is not installed.
    system : str
        Operating system and architecture.
    processors : int
    opengl : dict or None
        The driver's `renderer`, `vendor` and `version` in its own words, whether it is `software`,
        and whether it `computes`, as waves in OpenGL need; None if there is no usable context;
        `advice` then says what to install.
    backend : str
        The wave solver of "auto": "gl" or "cpu".
    measured : str
        What was measured to choose it, once on this machine; "" where nothing was.
    advice : str
        Problems that prevent or slow down rendering, with their fixes, one per line; "" if there is
        none.
    """
    opengl = None
    failure = ""
    try:
        context = shared_context()
    except GLError as error:
        failure = str(error)
    else:
        opengl = {
            name: getattr(context, name)
            for name in ("renderer", "vendor", "version", "software", "computes")
        }
    problems = find_problems(opengl["software"] if opengl else None)
    measurement = ""
    if opengl is not None:
        problems += find_drawing_threads(opengl["renderer"])
        if opengl["computes"] and not opengl["software"]:
            measurement = str(measured(context))
    return {
        "versions": {
            "python": platform.python_version(),
            **{name: _version(name) for name in PACKAGES},
        },
        "system": platform.platform(),
        "processors": os.cpu_count() or 1,
        "opengl": opengl,
        "backend": auto_backend(),
        "measured": measurement,
        "advice": "\n".join(problems) or failure,
    }


def as_text(info: dict[str, Any]) -> str:
    """Format the report as text."""
    rows = {name: version or "not installed" for name, version in info["versions"].items()}
    rows["system"] = f"{info['system']}, {info['processors']} processors"
    opengl = info["opengl"]
    if opengl is None:
        rows["OpenGL"] = "none"
        rows["renderer"] = "none: rendering is impossible"
    else:
        kind = "software" if opengl["software"] else "hardware"
        rows["OpenGL"] = f"{opengl['version']}, {opengl['vendor']}"
        rows["renderer"] = f"{opengl['renderer']} ({kind})"
    on_cpu = info["backend"] == "cpu"
    device = "on the CPU" if on_cpu else "on the GPU, in OpenGL compute shaders"
    rows["waves"] = f"{info['backend']} (auto: {device})"
    if info["measured"]:
        rows["measured"] = f"nine substeps: {info['measured']}"
    width = max(map(len, rows))
    lines = [f"{name:<{width}}  {value}" for name, value in rows.items()]
    if info["advice"]:
        lines += ["", info["advice"]]
    return "\n".join(lines)


def _version(name: str) -> str | None:
    """Version of a package; None if it is not installed."""
    if name == "ripple-sim":  # the metadata of a source tree may be older than the tree
        return __version__
    if name == "mujoco":  # installed under that name, or as `mujoco-core`
        return mujoco.__version__
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
