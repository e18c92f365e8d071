"""`WrittenAssets`: textures, height fields and meshes of a model that a program has changed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from ripple_sim.coupling.watched import WatchedArray


class Part(NamedTuple):
    """Where the content of an asset lies in an array of the model.

    Attributes
    ----------
    kind : str
        "texture", "hfield" or "mesh".
    asset : int
        Id of the asset.
    begin, entries : int
        First entry, and number of entries.
    """

    kind: str
    asset: int
    begin: int
    entries: int


def _textures(model: Any) -> Iterator[Part]:
    for i in range(model.ntex):
        count = int(model.tex_height[i]) * int(model.tex_width[i]) * int(model.tex_nchannel[i])
        yield Part("texture", i, int(model.tex_adr[i]), count)


def _height_fields(model: Any) -> Iterator[Part]:
    for i in range(model.nhfield):
        count = int(model.hfield_nrow[i]) * int(model.hfield_ncol[i])
        yield Part("hfield", i, int(model.hfield_adr[i]), count)


def _height_field_sizes(model: Any) -> Iterator[Part]:
    for i in range(model.nhfield):
        yield Part("hfield", i, i, 1)


def _mesh_vertices(model: Any) -> Iterator[Part]:
    for i in range(model.nmesh):
        yield Part("mesh", i, int(model.mesh_vertadr[i]), int(model.mesh_vertnum[i]))


def _mesh_coordinates(model: Any) -> Iterator[Part]:
    for i in range(model.nmesh):
        if model.mesh_texcoordadr[i] >= 0:
            yield Part("mesh", i, int(model.mesh_texcoordadr[i]), int(model.mesh_texcoordnum[i]))


# Arrays of the model with the content of assets, and functions that find the parts of the assets.
_ARRAYS = {
    "tex_data": _textures,
    "hfield_data": _height_fields,
    "hfield_size": _height_field_sizes,
    "mesh_vert": _mesh_vertices,
    "mesh_texcoord": _mesh_coordinates,
}


class WrittenAssets:
    """Finds the assets of a model whose content has changed since the last look."""

    def __init__(self, model: Any) -> None:
        self._model = model
        arrays = {name: getattr(model, name) for name in _ARRAYS}
        self._watched = {name: WatchedArray(array) for name, array in arrays.items() if array.size}

    def look(self) -> set[tuple[str, int]]:
        """Kind ("texture", "hfield" or "mesh") and id of the assets changed since the last look."""
        written = set()
        for name, watched in self._watched.items():
            array = getattr(self._model, name)
            if watched.changed(array):
                size = array.nbytes // len(array)  # of an entry [bytes]
                for part in _ARRAYS[name](self._model):
                    if watched.differs(array, part.begin * size, part.entries * size):
                        written.add((part.kind, part.asset))
                watched.take(array)
        return written
