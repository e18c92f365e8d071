"""Drawing of the project's packages, made from the imports in the source.

    python examples/plots/architecture.py

writes out/plots/architecture.svg and .png; with --docs it replaces docs/pictures/architecture.svg.
A red arrow closes a circle of imports.
"""

import argparse
import ast
import itertools
import textwrap
from collections import Counter
from pathlib import Path

import matplotlib as mpl
from figure import FAINT, FOLDER, TEXT, sheet
from imports import FOLDERS, ROOT, cycles, grouped, read, room
from layered import Layout, Node, layers, without_detours
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path as Curve

DOCS = ROOT / "docs" / "pictures"
SUBTITLE = (
    "an arrow means: imports (those that others imply are left out); blue: solver/, which "
    "knows nothing of MuJoCo"
)
# everybody may import these: no arrow is drawn to them
COMMON = (
    "ripple_sim.solver.errors",
    "ripple_sim.solver.kernel",
    "ripple_sim.solver.kernel_cache",
    "ripple_sim.solver.compile_clock",
    "ripple_sim.solver.files",
    "ripple_sim.solver.memory",
    "ripple_sim.errors",
)
ENTRY = "ripple_sim.__main__"

# of a box, between boxes, between layers [inches]
WIDTH = 2.5
HEIGHT = 0.92
GAP = 0.3
RISE = 0.42
INK, SOLVER, SIDE, WRONG = "#1f5fa8", "#e9f1f9", "#fbf6ee", "#c03020"


def description(name: str) -> tuple[str, list[str]]:
    """First sentence of a package's or module's docstring, and the packages inside."""
    folder, package = next(
        (f, p) for f, p in reversed(FOLDERS.items()) if name == p or name.startswith(f"{p}.")
    )
    path = ROOT.joinpath(folder, *name.removeprefix(package).split(".")[1:])
    text = (
        path / "__init__.py" if (path / "__init__.py").exists() else path.with_suffix(".py")
    ).read_text(encoding="utf-8")
    sentence = " ".join((ast.get_docstring(ast.parse(text)) or "").split("\n\n")[0].split())
    sentence = sentence.split(". ")[0].rstrip(".").replace("`", "")
    inside = [
        each.parent.name for each in sorted(path.glob("*/*.py")) if each.name == "__init__.py"
    ]
    return sentence, [each for each in inside if each != "shaders"]


class Drawing:
    """Boxes, their words, and the arrows between them, in inches."""

    def __init__(self, arrows: dict[str, set[str]]) -> None:
        self._layout = Layout(arrows, layers(arrows))
        x = {node: place * (WIDTH + GAP) for node, place in self._layout.x.items()}
        left = min(x.values()) - WIDTH / 2
        right = max(x.values()) + WIDTH / 2
        top = len(self._layout.rows) * (HEIGHT + RISE) - RISE
        self._y = {
            node: i * (HEIGHT + RISE) + HEIGHT / 2
            for i, row in enumerate(self._layout.rows)
            for node in row
        }
        self._x = {node: place - left for node, place in x.items()}
        self.width = right - left
        self.height = top

    def draw(self, axes: Axes) -> None:
        for way in self._layout.ways.values():
            self._arrow(axes, way)
        for node in self._x:
            if isinstance(node, str):
                self._box(axes, node)

    def draw_wrong_way(self, axes: Axes, importer: str, imported: str) -> None:
        """An arrow that points upwards, and closes a circle."""
        start = self._x[importer] + WIDTH / 2, self._y[importer]
        end = self._x[imported] + WIDTH / 2, self._y[imported]
        style = {
            "arrowstyle": "-|>",
            "connectionstyle": "arc3,rad=0.4",
            "color": WRONG,
            "linewidth": 1.6,
        }
        axes.annotate("", end, start, arrowprops=style, zorder=5)

    def _box(self, axes: Axes, name: str) -> None:
        x = self._x[name] - WIDTH / 2
        y = self._y[name] - HEIGHT / 2
        in_solver = name.startswith("ripple_sim.solver.")
        axes.add_patch(
            FancyBboxPatch(
                (x, y),
                WIDTH,
                HEIGHT,
                boxstyle="round,pad=0,rounding_size=0.07",
                linewidth=1.0,
                facecolor=SOLVER if in_solver else SIDE,
                edgecolor=INK if in_solver else "#b98b3e",
                zorder=3,
            )
        )
        sentence, inside = description(name)
        left = {"ha": "left", "va": "top", "zorder": 4}
        axes.text(
            x + 0.09,
            y + HEIGHT - 0.07,
            short(name),
            fontsize=10.5,
            fontweight="bold",
            color=TEXT,
            **left,
        )
        lines = textwrap.wrap(sentence, 39, max_lines=2 if inside else 4, placeholder=" ...")
        axes.text(
            x + 0.09,
            y + HEIGHT - 0.28,
            "\n".join(lines),
            fontsize=7.6,
            color=TEXT,
            linespacing=1.2,
            **left,
        )
        if inside:
            words = "\n".join(
                textwrap.wrap("  ".join(f"{each}/" for each in inside), 43, max_lines=2)
            )
            axes.text(
                x + 0.09, y + 0.06, words, fontsize=7.4, color=INK, ha="left", va="bottom", zorder=4
            )

    def _arrow(self, axes: Axes, way: list[Node]) -> None:
        first = way[0]
        last = way[-1]
        points = [(self._port(first, way[1], False), self._y[first] - HEIGHT / 2)]
        for node in way[1:-1]:
            points += [
                (self._x[node], self._y[node] + HEIGHT / 2),
                (self._x[node], self._y[node] - HEIGHT / 2),
            ]
        points.append((self._port(last, way[-2], True), self._y[last] + HEIGHT / 2 + 0.07))
        vertices = [points[0]]
        codes = [Curve.MOVETO]
        for i, (a, b) in enumerate(itertools.pairwise(points)):
            if i % 2:  # straight through a layer
                vertices.append(b)
                codes.append(Curve.LINETO)
            else:
                bend = 0.55 * (a[1] - b[1])
                vertices += [(a[0], a[1] - bend), (b[0], b[1] + bend), b]
                codes += [Curve.CURVE4] * 3
        axes.add_patch(
            PathPatch(Curve(vertices, codes), fill=False, edgecolor=FAINT, linewidth=1.1, zorder=2)
        )
        x, y = points[-1]
        axes.fill(
            [x - 0.045, x + 0.045, x],
            [y + 0.03, y + 0.03, y - 0.07],
            color=FAINT,
            linewidth=0,
            zorder=2,
        )

    def _port(self, node: Node, towards: Node, above: bool) -> float:
        """Point on a box's edge where an arrow begins or ends; arrows fan out in order."""
        ends = [
            way[-2] if above else way[1]
            for way in self._layout.ways.values()
            if (way[-1] if above else way[0]) == node
        ]
        ends.sort(key=lambda end: self._x[end])
        step = min(0.3, 0.8 * WIDTH / max(len(ends), 1))
        return self._x[node] + step * (ends.index(towards) - (len(ends) - 1) / 2)


def arrows() -> tuple[dict[str, set[str]], list[tuple[str, str]]]:
    """The direct imports between packages, without open modules, and the imports in a circle."""
    modules = read()
    rooms = {name: room(name) for name in modules if room(name) not in (*COMMON, ENTRY)}
    found = grouped(modules, rooms)
    closing = []
    while circles := cycles(found):
        # the thinnest arrow of the circle is the one that goes the wrong way
        thickness = Counter(
            (rooms.get(name), rooms.get(other))
            for name, each in modules.items()
            for other in each.imports
        )
        pairs = [(a, b) for a in circles[0] for b in found[a] if b in circles[0]]
        wrong = min(pairs, key=lambda pair: (thickness[pair], pair))
        found[wrong[0]].discard(wrong[1])
        closing.append(wrong)
    return without_detours(found), closing


def summary(arrows: dict[str, set[str]]) -> list[str]:
    """The arrows in words, which the drawing carries as its description."""
    return [f"{short(a)} to {short(b)}" for a, ends in sorted(arrows.items()) for b in sorted(ends)]


def short(name: str) -> str:
    """A package as it stands in the listing."""
    return name.removeprefix("ripple_sim.").replace(".", "/")


def make(folder: Path) -> Path:
    """Draw a PNG, whose path is returned, and an SVG beside it."""
    imports, closing = arrows()
    drawing = Drawing(imports)
    margin = 0.35
    head = 1.15
    foot = 0.75
    width = drawing.width + 2 * margin
    height = drawing.height + head + foot
    figure: Figure = sheet(width, height, "The packages", SUBTITLE)
    axes = figure.add_axes(
        (margin / width, foot / height, drawing.width / width, drawing.height / height)
    )
    axes.set_xlim(0, drawing.width)
    axes.set_ylim(0, drawing.height)
    axes.set_axis_off()
    drawing.draw(axes)
    for pair in closing:
        drawing.draw_wrong_way(axes, *pair)
    for artist in axes.get_children():
        artist.set_clip_on(False)
    common = ", ".join(map(short, COMMON))
    figure.text(
        0.35 / width,
        0.3 / height,
        f"open to all, without an arrow: {common}",
        fontsize=9,
        color=FAINT,
    )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "architecture.png"
    figure.savefig(path)
    with mpl.rc_context({"svg.hashsalt": "architecture", "svg.fonttype": "path"}):
        figure.savefig(
            path.with_suffix(".svg"),
            metadata={"Date": None, "Description": ", ".join(summary(imports))},
        )
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument(
        "--docs", action="store_true", help="replace the drawing of the documentation"
    )
    path = make(FOLDER)
    if parser.parse_args().docs:
        path = Path(path.with_suffix(".svg")).replace(DOCS / "architecture.svg")
    print(path)


if __name__ == "__main__":
    main()
