"""`PageTarget`: a target of a page, with its recorded loads or its recorded heights.

A page solves the waves of a target itself wherever it can: the law of the waves is written once,
and then the loads, which take little room. Other targets are replayed: their heights are predicted
from earlier ones and from the frame before.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import TargetId, is_geom
from ripple_sim.render.surfaces.vertices import memory_order
from ripple_sim.render.visuals.texture_mapping import TextureMapping
from ripple_sim.solver import WaveSolver
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.waves.tape import Event, Tape

from .moving_mesh import MovingMesh
from .page_coding import packed, parents_of, quantised, residuals
from .page_parts import look_meta, target_part
from .source import Source
from .visuals import mean_color, target_finish
from .wave_law import replay_reason, wave_law

_MAX_TRIANGLES = 16_000  # of a target, about
_HEIGHT_STEP = 5e-5  # of heights, in sizes of the object
_PLACE_STEP = 2e-5  # of the coordinates of moving vertices, in sizes of the mesh

_FORCE_DIGITS = 5  # of recorded forces and velocities

# A typical hit: of the frames with at least this share of the greatest push, this quantile.
_LEAST_PUSH = 0.1
_TYPICAL_QUANTILE = 0.8

# The poke of a run without a hit raises about this share of the object's size, from a footprint of
# this radius in the same sizes.
_POKE_HEIGHT = 0.015
_POKE_RADIUS = 0.04

# Speed of waves [texels] over the square root of the links' rate, on an even grid.
_SPEED_OF_RATE = 0.4


class _Frame(NamedTuple):
    """A target in a frame that waits to be written."""

    height: NDArray[np.float32]
    V: NDArray[np.float64] | None  # vertices of the target's mesh [m], if they have moved
    events: list[Event]  # since the frame before


class PageTarget:
    """A target: its part of the page, and over time what drives its waves, or its heights.

    The part's finer surface follows the target's mesh, of which nothing is written while it rests.

    Attributes
    ----------
    part : PagePart
    step : float
        Of recorded heights [m].
    solves : bool
        Whether the page solves the waves, so far.
    moves : bool
        Whether the target's own mesh has moved.
    """

    def __init__(self, source: Source, name: str) -> None:
        self._name = name
        self._source = source
        self._waves = source.ripples[name]
        self._surface = MovingMesh(
            self._waves.rest, source.tessellation, source.limited[name], _MAX_TRIANGLES
        )
        self.part = target_part(source, name, self._surface)
        self._size = float(np.ptp(self._surface.rest, axis=0).max())
        self.step = _HEIGHT_STEP * self._size
        self._point_parents = parents_of(self.part.F, len(self.part.vertices))
        mesh = self._waves.rest.mesh
        self._rest = mesh.V
        (self._F, self._order, _) = memory_order(mesh.F, mesh.V)
        self._parents = parents_of(self._F, len(mesh.V))
        self._place_step = _PLACE_STEP * float(np.ptp(mesh.V, axis=0).max())
        self._frames: list[_Frame] = []
        self.moves = False
        self.solves = False
        self._tape = Tape()
        self._pushes: list[float] = []  # of each frame, inwards [N s]

    def look(self, source: Source) -> dict[str, Any]:
        """How the target looks by a source with other paints, for its part of the page."""
        finish, _ = target_finish(source, self._name, self._surface)
        if self.part.meta["texture"] < 0 <= finish.texture:  # whose image the page does not have
            mean = mean_color(source.model, TextureMapping(texture=finish.texture))
            finish = finish._replace(color=finish.color * mean, texture=-1, glow=-1)
        return look_meta(source.model, finish)

    def begin(self) -> str:
        """Begin the run with the present state; return the law of its waves, or ""."""
        if self._source.replay:
            return ""
        target = self._source.ripples.geom_ids[self._name]
        reason = _replay_reason(self._source.model, target, self._waves)
        if reason:
            self._warn(reason)
            return ""
        self.solves = True
        self._waves.record(self._tape)
        return self._law(self._waves)

    def rival_law(self, operator: str) -> str:
        """The law of the waves by another operator, from the present state on; or ""."""
        if not self.solves:
            return ""
        return self._law(self._source.ripples.waves_by(self._name, operator))

    def _law(self, waves: WaveSolver) -> str:
        return wave_law(
            waves,
            limited=self._source.limited[self._name],
            points=self._surface.samples(self.part.vertices),
            pulse=self._pulse_of_the_material(),
        )

    def renewed(self) -> str:
        """The law of the waves from the latest frame on, if what was recorded has ended; or ""."""
        if not (self.solves and self._tape.broken):
            return ""
        self._tape = Tape()
        self._frames[-1] = self._frames[-1]._replace(events=[])
        return self.begin()

    def end(self) -> None:
        """End the recording."""
        self._waves.forget(self._tape)

    def add(self, V: NDArray[np.float64] | None) -> None:
        """Add a frame; `V` are the vertices of the target's mesh [m], if they have moved."""
        waves = self._source.ripples[self._name]
        if self.solves and waves is not self._waves:
            self._tape.broken = "gets another material or another surface"
        if self._tape.broken:
            self._waves.forget(self._tape)
        self._waves = waves
        self.moves = self.moves or V is not None
        events = self._tape.take()
        self._pushes.append(_push(events))
        moved = None if V is None else np.array(V)
        self._frames.append(_Frame(waves.height, moved, events))

    def flush(self) -> tuple[list[list[Any]] | None, list[bytes]]:
        """The frames since the last chunk: their events, or else their coded heights."""
        if self.solves and self._tape.broken:
            self.solves = False
            self._warn(self._tape.broken)
        if self.solves:
            return [_compact(frame.events) for frame in self._frames], []
        # a chunk begins from nothing, so that it can be decoded alone
        before = np.zeros(len(self.part.vertices), np.int64)
        coded = []
        for frame in self._frames:
            heights = self._surface.shape(frame.height, frame.height).height[self.part.vertices]
            now = quantised(heights, self.step)
            coded.append(residuals(now, before, self._point_parents))
            before = now
        return None, coded

    def motion(self) -> dict[str, Any]:
        """The mesh at rest, and the triangles and weights that move the page's points."""
        corners, weights, off, _, _ = self._surface.vertices.rest
        points = self.part.vertices
        far = max(float(np.abs(off).max()), 1e-30)  # largest offset from the mesh [m]
        arrays = [
            self._rest[self._order].astype("<f4"),
            self._F.astype("<u4"),
            np.argsort(self._order)[corners[points]].astype("<u4"),
            np.rint(weights[points, :2] * 65535).astype("<u2"),
            np.rint(off[points] / far * 32767).astype("<i2"),
        ]
        meta = {
            "points": len(self._order),
            "triangles": len(self._F),
            "step": self._place_step,
            "far": far,
        }
        return {**meta, "arrays": packed(b"".join(array.tobytes() for array in arrays))}

    def places(self) -> tuple[list[list[float]], bytes]:
        """Middles [m] and coded vertices of the frames since the last chunk, which are dropped.

        Both are empty if the surface never moved.
        """
        middles = []
        planes = []
        frames = self._frames
        before = np.zeros((3, len(self._order)), np.int64)  # a chunk can be decoded alone
        self._frames = []
        for frame in frames if self.moves else ():
            V = self._rest if frame.V is None else frame.V
            middle = np.round(V.mean(axis=0), 6)
            steps = quantised((V - middle)[self._order].T, self._place_step)
            planes += [
                residuals(now, last, self._parents) for now, last in zip(steps, before, strict=True)
            ]
            middles.append(middle.tolist())
            before = steps
        return middles, b"".join(planes)

    def typical_push(self) -> float:
        """Momentum that a frame with a hit brings to the waves [N s]; 0 without hits."""
        pushes = np.array(self._pushes)
        if not (pushes > 0).any():
            return 0.0
        hits = pushes[pushes > _LEAST_PUSH * pushes.max()]
        return float(np.quantile(hits, _TYPICAL_QUANTILE))

    def _pulse_of_the_material(self) -> float:
        """Impulse [N s] that raises the surface by a small share of the object's size."""
        operator = self._waves.operator
        spacing = np.sqrt(float(np.median(self._waves.rest.areas)))
        links, springs, _ = operator.rates
        speed = _SPEED_OF_RATE * spacing * np.sqrt(links or springs)
        radius = max(_POKE_RADIUS * self._size, 2 * spacing)
        density = float(np.median(operator.mass / self._waves.rest.areas))
        velocity = _POKE_HEIGHT * self._size * speed / radius
        return density * np.pi * radius**2 / 2 * velocity

    def _warn(self, reason: str) -> None:
        warn_caller(
            f"the page replays {self._name!r}, which cannot be poked there: it {reason}",
        )


def _push(events: list[Event]) -> float:
    """Momentum that events bring inwards [N s]."""
    force = 0.0
    momentum = 0.0
    for kind, first, second in events:
        if kind == "load":
            force = -float(np.sum(second))
        elif kind == "step":
            momentum += force * first * second
    return momentum


def _compact(events: list[Event]) -> list[list[Any]]:
    """Events as JSON has them; steps that follow each other are joined."""
    compact: list[list[Any]] = []
    for kind, first, second in events:
        if kind == "step":
            last = compact[-1] if compact else [""]
            if last[0] == "step" and last[2] == second:
                last[1] += first
            else:
                compact.append(["step", int(first), float(second)])
        else:
            values = [float(f"{value:.{_FORCE_DIGITS}g}") for value in second]
            compact.append([kind, np.asarray(first).tolist(), values])
    return compact


def _replay_reason(model: mujoco.MjModel, target: TargetId, waves: WaveSolver) -> str:
    """Why a page replays a target, in words after its name; "" if the page solves its waves."""
    if not is_geom(target, model):
        return "bends as a whole, as flexes and skins do"
    return replay_reason(waves)
