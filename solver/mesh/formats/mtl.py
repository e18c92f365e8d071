"""Material libraries (MTL) of OBJ files, as many programs write them.

Keywords may be in any case, names may have blanks and quotes, and paths may be those of another
computer.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath

import numpy as np

from ..looks import BLEND, CLAMP, OPAQUE, REPEAT, ImageSource, Paint, linear_light
from .text import decoded

# Options of a texture and the most numbers or words that each takes.
_OPTIONS = {
    "-blendu": 1,
    "-blendv": 1,
    "-bm": 1,
    "-boost": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-mm": 2,
    "-o": 3,
    "-s": 3,
    "-t": 3,
    "-texres": 1,
    "-type": 1,
}
# Options that may have fewer numbers.
_UP_TO = ("-o", "-s", "-t")

# Keywords of what is not shown, in words.
_NOT_SHOWN = {"bump": "normal maps", "map_bump": "normal maps", "norm": "normal maps"}

# A name that may have blanks, up to its ending.
_LIBRARY = re.compile(r"\S.*?\.mtl(?=\s|$)", re.IGNORECASE)

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


@dataclasses.dataclass(frozen=True)
class ObjMaterial:
    """A material, and what it does to the texture coordinates.

    Attributes
    ----------
    paint : Paint
    uv_scale, uv_offset : (float, float)
        Factor of the coordinates, and what is added to them then.
    not_shown : frozenset of str
        What the material has besides.
    """

    paint: Paint
    uv_scale: tuple[float, float] = (1.0, 1.0)
    uv_offset: tuple[float, float] = (0.0, 0.0)
    not_shown: frozenset[str] = frozenset()

    @property
    def keeps_uv(self) -> bool:
        """Whether the texture coordinates stay as they are."""
        return self.uv_scale == (1.0, 1.0) and self.uv_offset == (0.0, 0.0)


def read_libraries(
    obj_path: Path, statements: list[str]
) -> tuple[dict[str, ObjMaterial], list[str]]:
    """Materials of the libraries that an OBJ file names, by name, and notes on lost libraries.

    Parameters
    ----------
    obj_path : Path
    statements : list of str
        What follows each mtllib: the name of a file, which may have blanks, or several names.
    """
    paths: dict[Path, None] = {}
    lost = []
    for statement in statements:
        whole = found_file([obj_path.parent], _unquoted(statement))
        names = [statement] if whole is not None else _library_names(obj_path.parent, statement)
        for name in names:
            path = found_file([obj_path.parent], _unquoted(name))
            if path is None:
                lost.append(f"the material library {_unquoted(name)[:80]!r} is missing")
            else:
                paths[path] = None
    beside = obj_path.with_suffix(".mtl")
    if not paths and statements and beside.is_file():
        paths = {beside: None}
        lost = []
    materials: dict[str, ObjMaterial] = {}
    for path in paths:
        for name, material in _materials(path, obj_path.parent):
            materials.setdefault(name, material)
            materials.setdefault(name.lower(), material)
    return materials, lost


def _library_names(folder: Path, statement: str) -> list[str]:
    """Names of several libraries: behind each ending .mtl if there are such files, or at blanks."""
    names = _LIBRARY.findall(statement)
    is_found = [found_file([folder], _unquoted(name)) is not None for name in names]
    return names if names and all(is_found) else statement.split()


def _materials(path: Path, obj_folder: Path) -> Iterator[tuple[str, ObjMaterial]]:
    """The materials of a library by name, in the order of the file."""
    name = None
    said: dict[str, str] = {}
    folders = [path.parent, obj_folder]
    for line in decoded(path.read_bytes()).splitlines():
        words = line.split(maxsplit=1)
        if not words or words[0].startswith("#"):
            continue
        keyword = words[0].lower()
        rest = words[1].strip() if len(words) > 1 else ""
        if keyword == "newmtl":
            if name is not None:
                yield name, _material(said, folders)
            name = rest
            said = {}
        else:
            said[keyword] = rest
    if name is not None:
        yield name, _material(said, folders)


def _material(said: dict[str, str], folders: list[Path]) -> ObjMaterial:
    """A material of its lines: what follows each keyword in lower case."""
    texture = _texture(said.get("map_kd", ""), folders)
    opacity_texture = _texture(said.get("map_d", ""), folders)
    color = _color(said.get("kd", ""))
    # an image on black would not be seen: such lines mean the image alone
    if texture.image is not None and max(color) == 0:
        color = (1.0, 1.0, 1.0)
    opacity = _opacity(said)
    emission_texture = _texture(said.get("map_ke", ""), folders)
    emission = (0.0, 0.0, 0.0)
    # some programs write an image of the emission and leave its colour black
    if emission_texture.image is not None:
        emission = (1.0, 1.0, 1.0)
    if said.get("ke") and max(_color(said["ke"])) > 0:
        emission = _color(said["ke"])
    has_opacity = opacity < 1 or opacity_texture.image is not None
    not_shown = {words for keyword, words in _NOT_SHOWN.items() if said.get(keyword)}
    paint = Paint(
        color=(*color, opacity),
        image=texture.image,
        opacity=opacity_texture.image,
        wrap=(CLAMP, CLAMP) if texture.clamped else (REPEAT, REPEAT),
        alpha=BLEND if has_opacity else OPAQUE,
        metallic=_first_number(said.get("pm", "")),
        roughness=_first_number(said.get("pr", "")),
        emission=emission,
        emission_image=emission_texture.image,
    )
    textures = (texture, opacity_texture, emission_texture)
    source = next((each for each in textures if each.image is not None), texture)
    return ObjMaterial(paint, source.scale, source.offset, frozenset(not_shown))


def _opacity(said: dict[str, str]) -> float:
    """Opacity: `d`, or one less the transparency `Tr`; programs disagree on a `Tr` of 1 alone."""
    opacity = _first_number(said.get("d", "").lower().removeprefix("-halo"))
    if opacity is None:
        transparency = _first_number(said.get("tr", ""))
        opacity = 1.0 if transparency in (None, 1.0) else 1.0 - float(transparency or 0.0)
    return min(max(opacity, 0.0), 1.0)


def _color(text: str) -> tuple[float, float, float]:
    """Linear light of a colour: three numbers, or one for all; white without."""
    values = _leading_numbers(text.split(), 3)
    if not values:
        return (1.0, 1.0, 1.0)
    red, green, blue = linear_light(np.array([*values, *values[:1] * 2][:3])).tolist()
    return red, green, blue


@dataclasses.dataclass(frozen=True)
class _Texture:
    """A texture statement."""

    image: ImageSource | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamped: bool = False


def _texture(text: str, folders: list[Path]) -> _Texture:
    """A texture of its statement: options, and the name of a file, which may have blanks."""
    scale = (1.0, 1.0)
    offset = (0.0, 0.0)
    clamped = False
    words = text.split()
    while words and words[0].lower() in _OPTIONS and len(words) > 1:
        option = words[0].lower()
        count = _OPTIONS[option]
        values = words[1 : 1 + count]
        if option in _UP_TO:
            numbers = _leading_numbers(words[1:], count)
            values = words[1 : 1 + len(numbers)]
            if option == "-s":
                scale = _pair(numbers, 1.0)
            elif option == "-o":
                offset = _pair(numbers, 0.0)
        elif option == "-clamp":
            clamped = values[0].lower() == "on"
        for word in (option, *values):
            text = text.lstrip()[len(word) :]
        words = text.split()
    name = _unquoted(text)
    if not name:
        return _Texture()
    missing = folders[0] / PurePosixPath(_slashed(name)).name
    image = ImageSource(found_file(folders, name) or missing, name)
    return _Texture(image, scale, offset, clamped)


def found_file(folders: list[Path], name: str) -> Path | None:
    """The file that a name means: under one of the folders, in any case, or beside the mesh.

    The name may be the path of another computer; then its last part counts.
    """
    slashed = _slashed(name)
    last = PurePosixPath(slashed).name
    tries: list[Callable[[Path], Path | None]] = [
        lambda folder: _regular(folder / slashed),
        lambda folder: _in_any_case(folder, PurePosixPath(slashed)),
        lambda folder: _in_any_case(folder, PurePosixPath(last)),
    ]
    for find in tries:
        for folder in folders:
            path = find(folder) if last else None
            if path is not None:
                return path
    return None


def _in_any_case(folder: Path, name: PurePosixPath) -> Path | None:
    """A file under a folder whose name is the same but for upper and lower case."""
    path = folder
    for part in name.parts:
        if part in ("/", "."):
            continue
        if part != ".." and not _exists(path / part):
            try:
                entries = sorted(path.iterdir())
            except OSError:
                return None
            matches = [entry.name for entry in entries if entry.name.lower() == part.lower()]
            if not matches:
                return None
            part = matches[0]
        path = path / part
    return _regular(path)


def _regular(path: Path) -> Path | None:
    try:
        return path if path.is_file() else None
    except (OSError, ValueError):  # a name that the system does not allow
        return None


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _slashed(name: str) -> str:
    """A path with slashes, without the drive letter of Windows."""
    slashed = name.replace("\\", "/")
    return slashed[2:] if re.match(r"[A-Za-z]:/", slashed) else slashed


def _unquoted(name: str) -> str:
    name = name.strip()
    if len(name) > 1 and name[0] == name[-1] and name[0] in "\"'":
        return name[1:-1].strip()
    return name


def _pair(numbers: list[float], otherwise: float) -> tuple[float, float]:
    """The first two of some numbers, which may be fewer."""
    first, second = [*numbers, otherwise, otherwise][:2]
    return first, second


def _first_number(text: str) -> float | None:
    numbers = _leading_numbers(text.split(), 1)
    return numbers[0] if numbers else None


def _leading_numbers(words: list[str], most: int) -> list[float]:
    """The numbers with which words begin, `most` at most."""
    values: list[float] = []
    for word in words[:most]:
        if not _NUMBER.fullmatch(word):
            break
        values.append(float(word))
    return values
