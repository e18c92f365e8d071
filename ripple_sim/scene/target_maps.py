"""Values of a target texel by texel in a scene file, beside its material.

- `[ripple.height]` is the shape of the surface at the beginning. It may be an expression of the
  position, such as "0.02 * exp(-(x**2 + y**2) / 0.1**2)".
- `rim` may be given by region; expressions of the position say where a rim is.
- `[[ripple.inside]]` is a body under a layer, as a bone under the skin. It decides how thick the
  layer is.
"""

from __future__ import annotations

import ast
import dataclasses
import operator
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.geoms import find_target, to_body
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh, Volume, load_mesh, load_volume, texture_map
from ripple_sim.solver.errors import shown
from ripple_sim.solver.mesh.volume import is_volume
from ripple_sim.solver.operator.plate_rim import RIMS, Rim

# Functions of expressions, and how many arguments they take, by name.
FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    **{name: (getattr(np, name), 1) for name in ("abs", "sqrt", "exp", "log", "sin", "cos", "tan")},
    "atan2": (np.arctan2, 2),
    **{name: (getattr(np, name), 2) for name in ("hypot", "minimum", "maximum")},
    "where": (np.where, 3),
}

# Operators of expressions.
_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}

# Largest number of characters in an expression.
_MAX_LENGTH = 1000


def evaluate(text: str, variables: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Value of an expression of some variables, arrays of one shape.

    An expression consists of numbers, the variables, pi, + - * / % **, parentheses, the functions
    of `FUNCTIONS`, and one comparison at a time as the condition of `where`. It is not run as
    Python code. Raises `SceneError` if it holds anything else, or its value is not finite
    everywhere.
    """
    try:
        if len(text) > _MAX_LENGTH:
            raise SceneError(f"it must have at most {_MAX_LENGTH} characters, got {len(text)}")
        tree = ast.parse(text.strip(), mode="eval")
        with np.errstate(all="ignore"):
            value = _value(tree.body, {"pi": np.pi, **variables})
        result = np.zeros_like(next(iter(variables.values()))) + np.asarray(value, dtype=np.float64)
    except SceneError as error:
        raise SceneError(f"the expression {shown(text)} cannot be used: {error}") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError, TypeError) as error:
        raise SceneError(
            f"the expression {shown(text)} is not valid: {str(error).splitlines()[0]}"
        ) from error
    if not np.isfinite(result).all():
        raise SceneError(f"the expression must be finite everywhere, got {shown(text)}")
    return result


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    """Value of a node of an expression; raises `SceneError` for a node that is not allowed."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand, names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in FUNCTIONS:
            function, count = FUNCTIONS[name]
            if len(arguments) != count:
                raise SceneError(f"{name} must have {count} arguments, got {len(arguments)}")
            return function(*[_value(argument, names) for argument in arguments])
    valid = f"numbers, {', '.join(names)}, + - * / % **, and {', '.join(FUNCTIONS)}"
    raise SceneError(f"{shown(ast.unparse(node))} is unknown; an expression may have {valid}")


def _by_axis(points: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Coordinates x, y and z of points [..., 3] as variables of an expression."""
    return dict(zip("xyz", np.moveaxis(points, -1, 0), strict=True))


class HeightEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[ripple.height]`: the height at the beginning: an expression, an image, or a saved field.

    Where the waves conserve the volume, the mean is removed.
    """

    expression: str | None = None
    """Height [m] as an expression of the position x, y, z in the frame of the geom's body [m], such
    as "0.02 * exp(-(x**2 + y**2) / 0.1**2)"; functions are abs, sqrt, exp, log, sin, cos, tan,
    atan2, hypot, minimum, maximum and where(condition, then, otherwise)."""
    map: str | None = None
    """Instead, path of an image in the mesh's own texture coordinates."""
    low: float = 0.0
    """Height where the image is black [m]."""
    high: float = 0.01
    """Height where it is white [m]."""
    channel: str = "luminance"
    """Part of the image that counts."""
    field: str | None = None
    """Instead, path of a .npy with one height a texel [m], [C, n, n], as `numpy.save(path,
    waves.height)` writes it."""

    def located(self, folder: Path) -> HeightEntry:
        """The same entry, with its paths relative to a folder."""
        image = None if self.map is None else str(folder / self.map)
        field = None if self.field is None else str(folder / self.field)
        return msgspec.structs.replace(self, map=image, field=field)

    def check(self) -> None:
        """Raise `SceneError` unless there is one shape, and the files exist."""
        keys = [key for key in ("expression", "map", "field") if getattr(self, key) is not None]
        if len(keys) != 1:
            raise SceneError(
                "[ripple.height] must have one of expression, map, field, got "
                f"{' and '.join(keys) or 'none'}"
            )
        for key in ("map", "field"):
            path = getattr(self, key)
            if path is not None and not Path(path).is_file():
                raise SceneError(
                    f"ripple.height.{key} names the file {path!r}, which does not exist"
                )
        if self.expression is not None:
            evaluate(self.expression, dict.fromkeys("xyz", np.ones(0)))

    def heights(self, ripples: Ripples, geom: str) -> NDArray[np.float64]:
        """Height at every texel of a geom [m], [C, n, n].

        Raises `RippleError` if a file cannot be read or does not suit the target, or an expression
        is not finite.
        """
        atlas = ripples[geom].atlas
        if self.expression is not None:
            places = to_body(ripples.model, find_target(ripples.model, geom), atlas.positions)
            return evaluate(self.expression, _by_axis(places))
        if self.map is not None:
            return texture_map(atlas, self.map, self.low, self.high, self.channel)
        return _saved_field(self.field or "", atlas.areas.shape)


def _saved_field(path: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The heights in a .npy file [m], which must have a shape; raises `SceneError`."""
    try:
        field = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise SceneError(f"saved field {path!r} cannot be read: {error}") from error
    # np.load gives an archive for a .npz file
    is_array = isinstance(field, np.ndarray)
    if not is_array or field.shape != shape or field.dtype.kind not in "iuf":
        content = getattr(field, "shape", "no array")
        raise SceneError(f"saved field {path!r} must hold numbers {shape}, got {content}")
    if not np.isfinite(field).all():
        raise SceneError(f"saved field {path!r} has heights that are not finite")
    return field.astype(np.float64)


def check_rim(rim: str | dict[str, str]) -> None:
    """Raise `SceneError` unless `rim` of a target is a name, or a table of conditions by name."""
    valid = RIMS if isinstance(rim, str) else RIMS[:3]
    # a single name holds everywhere
    regions = {rim: "1"} if isinstance(rim, str) else rim
    for name in regions:
        if name not in valid:
            raise SceneError(f"rim must be one of {', '.join(valid)}, got {name!r}")
    for condition in regions.values():
        evaluate(condition, dict.fromkeys("xyz", np.ones(0)))


def rim_of(model: mujoco.MjModel, geom: str, rim: str | dict[str, str]) -> Rim:
    """The `rim` of a target as `Ripples` takes it: a name, or a function of the rims' points.

    The function raises `SceneError` for a closed surface, and for a condition that holds nowhere
    on the rims.
    """
    if isinstance(rim, str):
        return rim

    def conditions(points: NDArray[np.float64]) -> NDArray[np.str_]:
        if not len(points):
            raise SceneError(
                f"rim of geom {geom!r} names regions, and it has no rim: it is closed; leave rim "
                "out"
            )
        places = to_body(model, find_target(model, geom), points)
        names = np.full(len(points), "free", dtype="<U9")
        # the first condition that holds counts: it is set last
        for name, condition in reversed(rim.items()):
            holds = evaluate(condition, _by_axis(places)) != 0
            if not holds.any():
                low = places.min(axis=0).round(4).tolist()
                high = places.max(axis=0).round(4).tolist()
                raise SceneError(
                    f"rim {name!r} of geom {geom!r} is where {condition!r}, which holds nowhere on "
                    f"its rims; they lie from {low} to {high} m in the frame of its body"
                )
            names[holds] = name
        return names

    return conditions


class InsideEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple.inside]]`: a body under the layer.

    The distance to the body from each texel inwards is the layer's thickness. The material's preset
    must be one of a layer. Places are in the frame of the geom's body. Of several bodies the
    nearest counts; where no body is below, the layer is as thick as at its thickest, or as its
    limits let it be.
    """

    mesh: str | None = None
    """Path of a mesh file, relative to the scene file."""
    volume: str | None = None
    """Instead, path of a volume: NIfTI, NRRD, the folder of a DICOM series, or .npy. All but .npy
    need the package SimpleITK."""
    threshold: float | None = None
    """Value of the volume at the body's surface."""
    spacing: float | None = None
    """Between the nodes of a .npy [m]; a scan has its own."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the first node of a .npy is [m]."""
    scale: float = 1.0
    """To metres, where the file is in other units. Scans are read in metres."""

    def located(self, folder: Path) -> InsideEntry:
        """The same entry, with its path relative to a folder."""
        mesh = None if self.mesh is None else str(folder / self.mesh)
        volume = None if self.volume is None else str(folder / self.volume)
        return msgspec.structs.replace(self, mesh=mesh, volume=volume)

    def check(self) -> None:
        """Raise `SceneError` where keys are missing, too many, or out of range."""
        if (self.mesh is None) == (self.volume is None):
            raise SceneError(
                "a [[ripple.inside]] must name a mesh or a volume, got neither or both"
            )
        _check_threshold(self.mesh or self.volume, self.mesh is None, self.threshold, self.spacing)
        for key, value in (("scale", self.scale), ("spacing", self.spacing)):
            if value is not None and not value > 0:
                raise SceneError(
                    f"the {key} of a [[ripple.inside]] must be a number greater than 0, got "
                    f"{value!r}"
                )

    def body(self) -> Mesh | Volume:
        """The inner body, in the frame of the geom's body.

        Raises `MeshError` if the file cannot be read.
        """
        return load_inside(
            self.mesh or self.volume or "", self.threshold, self.spacing, self.origin, self.scale
        )


def moved(
    body: Mesh | Volume, to_atlas: Callable[[ArrayLike], NDArray[np.float64]]
) -> Mesh | Volume:
    """A body whose points [..., 3] [m] are moved by a function."""
    if isinstance(body, Mesh):
        return dataclasses.replace(body, V=to_atlas(body.V))
    origin = np.asarray(body.origin, dtype=np.float64)
    ends = to_atlas(origin + np.asarray(body.directions, dtype=np.float64).T)
    return dataclasses.replace(
        body, origin=to_atlas(origin), directions=(ends - to_atlas(origin)).T
    )


def load_inside(
    path: str | Path,
    threshold: float | None = None,
    spacing: float | None = None,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale: float = 1.0,
) -> Mesh | Volume:
    """Read the inner body, scaled: a volume if the path has a volume's ending, else a mesh.

    Raises
    ------
    MeshError
        If the file cannot be read.
    SceneError
        If a volume comes without a threshold, or a mesh with one.
    """
    _check_threshold(path, is_volume(path), threshold, spacing)
    if threshold is None:
        mesh = load_mesh(path)
        return dataclasses.replace(mesh, V=scale * mesh.V)
    volume = load_volume(path, threshold, spacing, origin)
    if scale == 1:
        return volume
    return dataclasses.replace(
        volume,
        origin=scale * np.asarray(volume.origin),
        spacing=scale * np.asarray(volume.spacing),
    )


def _check_threshold(
    path: Any, is_volume: bool, threshold: float | None, spacing: float | None
) -> None:
    """Raise `SceneError` if a volume comes without a threshold, or a mesh with one."""
    if is_volume and threshold is None:
        raise SceneError(
            f"{str(path)!r} is a volume, which needs a threshold: its value at the surface of what "
            "is inside, about 300 for bone in Hounsfield units"
        )
    if not is_volume and (threshold is not None or spacing is not None):
        raise SceneError(
            f"{str(path)!r} is a mesh, which takes no threshold and no spacing; leave them out"
        )
