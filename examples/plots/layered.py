"""A layered drawing of a graph without cycles: arrows point downwards, and rarely cross.

Layers come from the longest path, arrows over several layers run through places kept free for them,
the order within each layer is improved by barycentres, and positions by least movement (Sugiyama,
Tagawa and Toda 1981).
"""

import itertools
from collections.abc import Iterable, Mapping
from statistics import fmean

import numpy as np

Arrows = Mapping[str, Iterable[str]]
Node = str | tuple[str, str, int]  # a tuple: the place of an arrow on a layer that it passes


def without_detours(arrows: Arrows) -> dict[str, set[str]]:
    """Transitive reduction: an arrow that other arrows make up in steps is left out."""
    reach: dict[str, set[str]] = {}

    def reached(node: str) -> set[str]:
        if node not in reach:
            reach[node] = set()
            for other in arrows[node]:
                reach[node] |= {other} | reached(other)
        return reach[node]

    return {
        node: {b for b in ends if not any(b in reached(c) for c in ends if c != b)}
        for node, ends in arrows.items()
    }


def layers(arrows: Arrows) -> dict[str, int]:
    """Layer of every node from 0 at the bottom; a node rises while its arrows get shorter."""
    level: dict[str, int] = {}

    def find(node: str) -> int:
        if node not in level:
            level[node] = 1 + max((find(other) for other in sorted(arrows[node])), default=-1)
        return level[node]

    above: dict[str, list[str]] = {node: [] for node in arrows}
    for node, ends in arrows.items():
        find(node)
        for end in ends:
            above[end].append(node)
    for node in sorted(arrows, key=lambda each: -level[each]):
        if len(above[node]) > len(list(arrows[node])):
            level[node] = min(level[each] for each in above[node]) - 1
    return level


class Layout:
    """Places of the nodes [unit widths, layers], and the paths of the arrows between them."""

    def __init__(
        self, arrows: Arrows, level: Mapping[str, int], passage: float = 0.3, trials: int = 60
    ) -> None:
        self._passage = passage
        self._segments: list[tuple[Node, Node]] = []
        self.ways: dict[tuple[str, str], list[Node]] = {}
        rows: dict[int, list[Node]] = {}
        for node, row in level.items():
            rows.setdefault(row, []).append(node)
        for node, ends in arrows.items():
            for end in sorted(ends):  # sets have another order in each process
                passed: list[Node] = [
                    (node, end, row) for row in range(level[node] - 1, level[end], -1)
                ]
                for place, row in zip(passed, range(level[node] - 1, level[end], -1), strict=True):
                    rows[row].append(place)
                self.ways[node, end] = [node, *passed, end]
                self._segments += itertools.pairwise(self.ways[node, end])
        self.rows = [rows[row] for row in sorted(rows)]
        self._neighbours: dict[Node, list[Node]] = {node: [] for row in self.rows for node in row}
        for a, b in self._segments:
            self._neighbours[a].append(b)
            self._neighbours[b].append(a)
        self._row = {node: i for i, row in enumerate(self.rows) for node in row}
        self._order(np.random.default_rng(0), trials)
        self.x = self._positions()

    def crossings(self) -> int:
        """How often arrows cross."""
        place = {node: i for row in self.rows for i, node in enumerate(row)}
        count = 0
        for (a, b), (c, d) in itertools.combinations(self._segments, 2):
            if self._row[a] == self._row[c]:
                count += (place[a] - place[c]) * (place[b] - place[d]) < 0
        return count

    def _order(self, rng: np.random.Generator, trials: int) -> None:
        best = None
        found = None
        for _ in range(trials):
            for row in self.rows:
                rng.shuffle(row)
            for sweep in range(12):
                for i in range(len(self.rows)) if sweep % 2 else reversed(range(len(self.rows))):
                    place = {
                        node: k / max(len(row) - 1, 1)
                        for row in self.rows
                        for k, node in enumerate(row)
                    }
                    self.rows[i].sort(
                        key=lambda node: fmean([place[n] for n in self._neighbours[node]] or [0.5])
                    )
                crossed = self.crossings()
                if best is not None and crossed > best[0]:
                    continue
                x = self._positions(8)
                cost = (crossed, sum(abs(x[a] - x[b]) for a, b in self._segments))
                if best is None or cost < best:
                    best = cost
                    found = [list(row) for row in self.rows]
        self.rows = found or self.rows

    def _positions(self, rounds: int = 200) -> dict[Node, float]:
        """Each node between its neighbours, as far as its row has room."""
        x = {}
        for row in self.rows:
            edges = np.cumsum([0.0, *(self._gap(a, b) for a, b in itertools.pairwise(row))])
            x.update(zip(row, edges - edges[-1] / 2, strict=True))
        for _ in range(rounds):
            for row in self.rows:
                wanted = [self._wanted(node, x) for node in row]
                gaps = np.cumsum([0.0, *(self._gap(a, b) for a, b in itertools.pairwise(row))])
                firm = np.array([4.0 if isinstance(node, tuple) else 1.0 for node in row])
                x.update(zip(row, _increasing(np.array(wanted) - gaps, firm) + gaps, strict=True))
        return x

    def _wanted(self, node: Node, x: dict[Node, float]) -> float:
        """Mean place of a node's neighbours; long arrows pull at their own passages."""
        near = self._neighbours[node] or [node]
        pull = [
            8.0 if isinstance(node, tuple) and isinstance(each, tuple) else 1.0 for each in near
        ]
        return fmean([x[each] for each in near], pull)

    def _gap(self, a: Node, b: Node) -> float:
        """Least distance of two nodes side by side."""
        width = [self._passage if isinstance(node, tuple) else 1.0 for node in (a, b)]
        return sum(width) / 2


def _increasing(wanted: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The nearest sequence that never decreases, by least squares (pooled adjacent violators)."""
    pools: list[tuple[float, float, int]] = []  # mean, weight, length
    for value, weight in zip(wanted, weights, strict=True):
        pools.append((value, weight, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (a, m, j), (b, n, k) = pools[-2:]
            pools[-2:] = [((a * m + b * n) / (m + n), m + n, j + k)]
    return np.concatenate([np.full(length, mean) for mean, _, length in pools])
