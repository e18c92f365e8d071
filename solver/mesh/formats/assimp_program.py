"""A program that reads a mesh file with assimp and writes its triangles to another file.

`other` starts it as a process of its own, because assimp ends the process in which it runs on some
damaged files.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

# Number of an image of diffuse or base colour in assimp's list of a material's textures.
_IMAGES = (12, 1)

# The same of emission.
_EMISSION_IMAGES = 4

# The same of images that are not shown, with what they are.
_NOT_SHOWN = {
    5: "normal maps",  # heights
    6: "normal maps",
    10: "occlusion",  # light maps
    15: "metalness and roughness by image",
    16: "metalness and roughness by image",
    17: "occlusion",
}


def main(source: str, target: str) -> None:
    """Read `source`, and write the triangles of all nodes and their materials to `target`."""
    import assimp_py

    scene = assimp_py.import_file(source, assimp_py.Process_Triangulate)
    V = [np.empty((0, 3))]
    F = [np.empty((0, 3), np.int64)]
    uv = [np.empty((0, 2))]
    colors = [np.empty((0, 4))]
    material = [np.empty(0, np.int64)]
    count = 0
    for mesh, transform in _placed(scene):
        points = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.array(mesh.indices, dtype=np.int64).reshape(-1, 3)
        if np.linalg.det(transform[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        V.append(points @ transform[:3, :3].T + transform[:3, 3])
        F.append(triangles + count)
        uv.append(_coordinates(mesh, len(points)))
        colors.append(_colors(mesh, len(points)))
        material.append(np.full(len(triangles), mesh.material_index))
        count += len(points)
    materials = [_material(material) for material in scene.materials]
    np.savez(
        target,
        V=np.concatenate(V),
        F=np.concatenate(F),
        uv=np.concatenate(uv),
        colors=np.concatenate(colors),
        material=np.concatenate(material),
        materials=json.dumps(materials),
    )


def _placed(scene: Any) -> Iterator[tuple[Any, np.ndarray]]:
    """Meshes with the transforms of the nodes that show them, [4, 4]."""
    stack = [(scene.root_node, np.eye(4))]
    while stack:
        node, parent = stack.pop()
        transform = parent @ np.array(node.transformation)
        for index in node.mesh_indices:
            yield scene.meshes[index], transform
        stack += [(child, transform) for child in reversed(node.children)]


def _coordinates(mesh: Any, count: int) -> np.ndarray:
    """The first texture coordinates; NaN without."""
    if not mesh.texcoords:
        return np.full((count, 2), np.nan)
    return np.array(mesh.texcoords[0], dtype=np.float64).reshape(count, -1)[:, :2]


def _colors(mesh: Any, count: int) -> np.ndarray:
    """The first colours; NaN without."""
    if not mesh.colors:
        return np.full((count, 4), np.nan)
    return np.array(mesh.colors[0], dtype=np.float64).reshape(count, 4)


def _material(material: dict[str, Any]) -> dict[str, Any]:
    """Colour, opacity and image of a material of assimp."""
    color = material.get("COLOR_DIFFUSE", (1.0, 1.0, 1.0))
    textures = material.get("TEXTURES", {})
    emission = material.get("COLOR_EMISSIVE", (0.0, 0.0, 0.0))
    emission_images = list(textures.get(_EMISSION_IMAGES, ()))
    images: list[str] = []
    for number in _IMAGES:
        images += textures.get(number, ())
    return {
        "color": [float(value) for value in color[:3]],
        "opacity": float(material.get("OPACITY", 1.0)),
        "image": images[0] if images else None,
        "emission": [float(value) for value in emission[:3]],
        "emission_image": emission_images[0] if emission_images else None,
        "not_shown": [words for number, words in _NOT_SHOWN.items() if textures.get(number)],
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
