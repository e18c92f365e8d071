"""glTF 2.0 files (.glb, .gltf) as triangles: the scene at rest, with its materials.

Nodes are where their transforms put them; skins and morph targets have the pose that the nodes and
the weights give without an animation.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ...memory import require_memory
from ..clean import counted
from ..looks import Looks, Paint
from ..soup import Soup
from .gltf_document import UNCOMPRESS, Document, unit_numbers
from .gltf_looks import GltfMaterial, gltf_material

# Modes of primitives that are triangles (section 3.7.2.1); lower modes are points and lines.
_TRIANGLES = 4
_STRIP = 5
_FAN = 6

# Extensions without which a file is read as its author meant it: the materials' ones are in
# `gltf_looks`, and lights, cameras and animations are no part of a mesh.
_DRACO = "KHR_draco_mesh_compression"
_INSTANCES = "EXT_mesh_gpu_instancing"
_HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_dds",
    "KHR_mesh_quantization",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_animation_pointer",
    "KHR_node_visibility",
    _DRACO,
    _INSTANCES,
)

# Memory of a triangle while a file is read [bytes].
_TRIANGLE_BYTES = 300


class _Part(NamedTuple):
    """A primitive in the world.

    Attributes
    ----------
    V : float64 [n, 3]
    F : int64 [m, 3]
    uv : float64 [n, 2] or None
        Texture coordinates of the image; v is counted from the upper edge.
    colors : float64 [n, 4] or None
        Linear light and opacity.
    material : int
        -1 without.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    colors: NDArray[np.float64] | None
    material: int


def read_gltf(path: Path) -> Soup:
    """Triangles of a glTF 2.0 file.

    Raises `MeshError` if the file is damaged, of another version, or compressed in a way that is
    not read; the message names what undoes the compression.
    """
    document = Document(path.read_bytes(), path.parent)
    reader = _Reader(document)
    parts = list(reader.parts())
    looks, corner_uv = reader.looks(parts)
    starts = np.cumsum([0, *(len(part.V) for part in parts)])
    V = np.concatenate([np.empty((0, 3)), *(part.V for part in parts)])
    F = [part.F + start for part, start in zip(parts, starts, strict=False)]
    all_F = np.concatenate([np.empty((0, 3), np.int64), *F])
    return Soup(V, all_F, corner_uv, tuple(reader.notes()), looks)


class _Reader:
    """Reads the primitives of a document."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._materials: dict[int, GltfMaterial] = {}
        self._thin_primitives = 0  # points and lines
        self._bytes = 0

    def parts(self) -> Iterator[_Part]:
        """Primitives of triangles, in the order of the scene's nodes; points as parts without."""
        document = self._document
        world = _world_transforms(document)
        for index in _scene_nodes(document, world):
            node = document.entry("nodes", index)
            if "mesh" not in node:
                continue
            mesh = document.entry("meshes", node["mesh"])
            weights = node.get("weights", mesh.get("weights", ()))
            joints = _joint_transforms(document, node, world)
            transforms = [world[index]] if joints is None else [np.eye(4)]
            if _INSTANCES in node.get("extensions", {}) and joints is None:
                transforms = _instances(document, node, world[index])
            for primitive in mesh["primitives"]:
                part = self._part(primitive, weights, joints)
                for transform in transforms:
                    yield self._placed(part, transform)

    def _placed(self, part: _Part, transform: NDArray[np.float64]) -> _Part:
        """A primitive where a transform puts it; a mirrored one is wound the other way."""
        self._bytes += _TRIANGLE_BYTES * len(part.F)
        require_memory(MeshError, self._bytes, "its triangles", "take a coarser mesh")
        if np.array_equal(transform, np.eye(4)):  # it would still round
            return part
        V = part.V @ transform[:3, :3].T + transform[:3, 3]
        mirrored = np.linalg.det(transform[:3, :3]) < 0
        return part._replace(V=V, F=part.F[:, ::-1] if mirrored else part.F)

    def _part(
        self, primitive: dict[str, Any], weights: Any, joints: NDArray[np.float64] | None
    ) -> _Part:
        mode = primitive.get("mode", _TRIANGLES)
        attributes = primitive.get("attributes", {})
        if "POSITION" not in attributes:
            return _Part(np.empty((0, 3)), np.empty((0, 3), np.int64), None, None, -1)
        material = int(primitive.get("material", -1))
        look = self._material(material)
        names = {"POSITION", "COLOR_0"} & attributes.keys()
        uv_name = f"TEXCOORD_{0 if look is None else look.uv_set}"
        if uv_name in attributes:
            names.add(uv_name)
        if joints is not None:
            names |= {name for name in attributes if name.startswith(("JOINTS_", "WEIGHTS_"))}
        values, index = self._values(primitive, sorted(names))
        V = values["POSITION"]
        if mode < _TRIANGLES:
            self._thin_primitives += 1
            return _Part(V, np.empty((0, 3), np.int64), None, None, -1)
        if len(index) and index.max() >= len(V):
            raise MeshError(
                f"the vertices of triangles must be 0 to {len(V) - 1}, got {index.max()}"
            )
        V = self._morphed(V, primitive.get("targets", ()), weights)
        if joints is not None:
            V = _skinned(V, values, joints)
        uv = values.get(uv_name)
        if uv is not None and look is not None:
            uv = uv @ look.uv_transform[:, :2].T + look.uv_transform[:, 2]
        part = _Part(V, _triangles(index, mode), uv, _colors(values.get("COLOR_0")), material)
        return _without_unused(part)

    def _values(
        self, primitive: dict[str, Any], names: list[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64]]:
        """Attributes of a primitive as numbers, and its indices."""
        document = self._document
        attributes = primitive["attributes"]
        if _DRACO in primitive.get("extensions", {}):
            return _draco(document, primitive, names)
        values = {}
        for name in names:
            elements = document.accessor(attributes[name])
            values[name] = _numbers(document, attributes[name], name, elements)
        if "indices" in primitive:
            index = document.accessor(primitive["indices"])[:, 0].astype(np.int64)
        else:
            index = np.arange(len(values["POSITION"]))
        return values, index

    def _morphed(self, V: NDArray[np.float64], targets: Any, weights: Any) -> NDArray[np.float64]:
        """Vertices moved by morph targets with their weights."""
        for target, weight in zip(targets, weights, strict=False):
            if weight and "POSITION" in target:
                V = V + float(weight) * self._document.numbers(target["POSITION"])
        return V

    def _material(self, index: int) -> GltfMaterial | None:
        if index < 0:
            return None
        if index not in self._materials:
            self._materials[index] = gltf_material(self._document, index)
        return self._materials[index]

    def looks(self, parts: list[_Part]) -> tuple[Looks | None, NDArray[np.float64] | None]:
        """Looks and texture coordinates of the corners of all parts."""
        corner_uv = None
        if any(part.uv is not None for part in parts):
            uvs = []
            for part in parts:
                uv = np.zeros((len(part.V), 2)) if part.uv is None else part.uv
                # a mesh counts v from the lower edge
                uvs.append((uv * [1.0, -1.0] + [0.0, 1.0])[part.F])
            corner_uv = np.concatenate(uvs)
        colored = any(part.colors is not None for part in parts)
        if not colored and not any(part.material >= 0 and len(part.F) for part in parts):
            return None, corner_uv
        numbers = sorted({part.material for part in parts})
        paints = []
        for number in numbers:
            material = self._material(number)
            paints.append(Paint() if material is None else material.paint)
        paint = [np.full(len(part.F), numbers.index(part.material)) for part in parts]
        colors = None
        if colored:
            rows = []
            for part in parts:
                color = np.ones((len(part.V), 4)) if part.colors is None else part.colors
                rows.append(color[part.F])
            colors = np.concatenate(rows)
        not_shown = [material.not_shown for material in self._materials.values()]
        words = sorted(set().union(*not_shown))
        notes = (f"not shown of its materials: {', '.join(words)}",) if words else ()
        return Looks(tuple(paints), np.concatenate(paint), colors, notes), corner_uv

    def notes(self) -> Iterator[str]:
        """What was left out."""
        root = self._document.root
        if self._thin_primitives:
            yield f"{counted(self._thin_primitives, 'primitive')} of points or lines left out"
        unknown = [
            str(name)
            for name in root.get("extensionsRequired", ())
            if not str(name).startswith(_HARMLESS)
        ]
        if unknown:
            yield f"it requires {', '.join(unknown)}, which is not read: it may look different"
        if root.get("animations"):
            yield "animations ignored: it is shown at rest"


def _without_unused(part: _Part) -> _Part:
    """A primitive with the vertices of its triangles alone; several may share their attributes."""
    used = np.zeros(len(part.V), dtype=bool)
    used[part.F] = True
    if used.all():
        return part
    number = np.cumsum(used) - 1
    return part._replace(
        V=part.V[used],
        F=number[part.F],
        uv=None if part.uv is None else part.uv[used],
        colors=None if part.colors is None else part.colors[used],
    )


def _triangles(index: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Triangles of a list, a strip or a fan of vertices."""
    if mode == _STRIP:
        F = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
        F[1::2] = F[1::2, [1, 0, 2]]
        return F
    if mode == _FAN:
        return np.stack(
            [np.broadcast_to(index[:1], index[2:].shape), index[1:-1], index[2:]], axis=1
        )
    return index[: len(index) // 3 * 3].reshape(-1, 3)


def _colors(colors: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Vertex colours with opacity."""
    if colors is None:
        return None
    opaque = np.ones((len(colors), 4))
    opaque[:, : colors.shape[1]] = np.clip(np.nan_to_num(colors[:, :4]), 0.0, 1.0)
    return opaque


def _scene_nodes(document: Document, world: dict[int, NDArray[np.float64]]) -> list[int]:
    """Nodes of the scene that is shown, in the order of its tree."""
    if not document.count("scenes"):
        return sorted(world)
    scene = document.entry("scenes", document.root.get("scene", 0))
    stack = list(reversed(scene.get("nodes", [])))
    nodes = []
    while stack:
        index = stack.pop()
        nodes.append(index)
        if len(nodes) > document.count("nodes"):
            raise MeshError("a node belongs to its scene twice, but must do so once")
        stack += reversed(document.entry("nodes", index).get("children", []))
    return nodes


def _world_transforms(document: Document) -> dict[int, NDArray[np.float64]]:
    """The transform of each node into the world, [4, 4]."""
    parent: dict[int, int] = {}
    for index in range(document.count("nodes")):
        for child in document.entry("nodes", index).get("children", []):
            document.entry("nodes", child)
            if child in parent:
                raise MeshError(f"nodes[{child}] has two parents, but must have one")
            parent[child] = index
    world: dict[int, NDArray[np.float64]] = {}
    for index in range(document.count("nodes")):
        chain = []
        node: int | None = index
        while node is not None and node not in world:
            chain.append(node)
            if len(chain) > document.count("nodes"):
                raise MeshError(f"nodes[{index}] is among its own parents")
            node = parent.get(node)
        for below in reversed(chain):
            own = _transform(document.entry("nodes", below))
            world[below] = world[parent[below]] @ own if below in parent else own
    return world


def _transform(node: dict[str, Any]) -> NDArray[np.float64]:
    """A node's transform to its parent: a matrix, column by column, or its factors."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    return _composed(
        np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=np.float64),
        np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), dtype=np.float64),
        np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64),
    )


def _composed(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The matrix that scales, turns by a quaternion (x, y, z, w), and moves."""
    x, y, z, w = rotation / max(float(np.linalg.norm(rotation)), np.finfo(float).tiny)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    transform = np.eye(4)
    transform[:3, :3] = turn * scale
    transform[:3, 3] = translation
    return transform


def _instances(
    document: Document, node: dict[str, Any], world: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Transforms of the instances of a node (EXT_mesh_gpu_instancing)."""
    attributes = node["extensions"][_INSTANCES].get("attributes", {})
    transforms = {
        name: document.numbers(attributes[name])
        for name in ("TRANSLATION", "ROTATION", "SCALE")
        if name in attributes
    }
    count = min((len(values) for values in transforms.values()), default=1)
    move = transforms.get("TRANSLATION", np.zeros((count, 3)))
    turn = transforms.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
    size = transforms.get("SCALE", np.ones((count, 3)))
    return [world @ _composed(move[i], turn[i], size[i]) for i in range(count)]


def _joint_transforms(
    document: Document, node: dict[str, Any], world: dict[int, NDArray[np.float64]]
) -> NDArray[np.float64] | None:
    """Transforms of the joints of a node's skin at rest, [joint_count, 4, 4]; None without one."""
    if "skin" not in node:
        return None
    skin = document.entry("skins", node["skin"])
    joints = skin["joints"]
    for joint in joints:
        document.entry("nodes", joint)
    transforms = np.array([world[joint] for joint in joints])
    if "inverseBindMatrices" in skin:
        inverse = document.numbers(skin["inverseBindMatrices"])
        if inverse.shape[0] < len(joints) or inverse.shape[1] != 16:
            raise MeshError(f"a skin has {len(inverse)} matrices for {len(joints)} joints")
        transforms = transforms @ inverse[: len(joints)].reshape(-1, 4, 4).swapaxes(1, 2)
    return transforms


def _skinned(
    V: NDArray[np.float64], values: dict[str, NDArray[np.float64]], joints: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertices where the joints [joint_count, 4, 4] of a skin move them (section 3.7.3.3)."""
    moved = np.zeros_like(V)
    total = np.zeros(len(V))
    for name in sorted(values):
        weights = values.get(name.replace("JOINTS_", "WEIGHTS_"))
        if not name.startswith("JOINTS_") or weights is None:
            continue
        for joint, weight in zip(values[name].astype(np.int64).T, weights.T, strict=True):
            if len(joint) and joint.max() >= len(joints):
                raise MeshError(f"a vertex refers to joint {joint.max()} of {len(joints)}")
            for number in np.unique(joint[weight != 0]):
                chosen = (joint == number) & (weight != 0)
                matrix = joints[number]
                place = V[chosen] @ matrix[:3, :3].T + matrix[:3, 3]
                moved[chosen] += weight[chosen, None] * place
            total += weight
    return np.where(total[:, None] > 0, moved / np.where(total > 0, total, 1.0)[:, None], V)


def _draco(
    document: Document, primitive: dict[str, Any], names: list[str]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64]]:
    """Attributes and indices of a primitive that is compressed with Draco, by DracoPy."""
    if importlib.util.find_spec("DracoPy") is None:
        raise MeshError(
            f"it is compressed with Draco ({_DRACO}); run pip install 'ripple-sim[draco]', or undo "
            f"the compression with {UNCOMPRESS}"
        )
    import DracoPy

    extension = primitive["extensions"][_DRACO]
    data = document.view(extension.get("bufferView"))
    try:
        mesh = DracoPy.decode(data)
        index = np.asarray(mesh.faces, dtype=np.int64).reshape(-1)
    except (DracoPy.FileTypeException, ValueError, AttributeError) as error:
        raise MeshError(
            f"it is compressed with Draco ({_DRACO}), and the data cannot be read: {error}; undo "
            f"the compression with {UNCOMPRESS}"
        ) from error
    stored = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    values = {}
    for name in names:
        number = extension["attributes"].get(name)
        if number not in stored:
            continue
        elements = np.asarray(stored[number])
        elements = elements.reshape(len(elements), -1)
        values[name] = _numbers(document, primitive["attributes"][name], name, elements)
    return values, index


def _numbers(
    document: Document, accessor: Any, name: str, elements: NDArray
) -> NDArray[np.float64]:
    """Elements of an attribute as numbers.

    Integers are normalized where the accessor says so, and colours and weights, which can be
    nothing else, always: some writers do not say so.
    """
    normalized = document.entry("accessors", accessor).get("normalized", False)
    if normalized or name.startswith(("COLOR_", "WEIGHTS_")):
        return unit_numbers(elements)
    return elements.astype(np.float64)
