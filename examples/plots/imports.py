"""Imports between the project's modules, read from the source tree without importing.

Folders stand where they are installed: solver/ is ripple_sim.solver, scenes/ is ripple_sim.scenes.
An import of a public name, such as `from ripple_sim.solver import Material`, counts as one of the
module that the name comes from. What a room offers stands in its `__init__.pyi`; the `__init__`
files, which only hand such names on, are not counted as modules.
"""

import ast
import dataclasses
import functools
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = {"ripple_sim": "ripple_sim", "solver": "ripple_sim.solver", "scenes": "ripple_sim.scenes"}


@dataclasses.dataclass(frozen=True)
class Module:
    """A Python file: module name, path, text, syntax tree, and the project's modules it imports."""

    name: str
    path: Path
    text: str
    tree: ast.Module
    imports: frozenset[str]

    @property
    def package(self) -> str:
        return self.name.rpartition(".")[0]


@functools.cache
def read(root: Path = ROOT) -> dict[str, Module]:
    """All modules of the project, by name."""
    paths = {}
    for folder, package in FOLDERS.items():
        for path in sorted((root / folder).rglob("*.py")):
            inside = path.relative_to(root / folder).with_suffix("")
            paths[".".join((package, *inside.parts))] = path
    texts = {name: path.read_text(encoding="utf-8") for name, path in paths.items()}
    trees = {name: ast.parse(text) for name, text in texts.items()}
    stubs = {name: path.with_suffix(".pyi") for name, path in paths.items()}
    offers = {
        name: ast.parse(path.read_text(encoding="utf-8"))
        for name, path in stubs.items()
        if path.is_file()
    }
    public = {
        f"{name.removesuffix('.__init__')}.{given}": f"{module}.{original}"
        for name, tree in offers.items()
        for module, original, given in _imported(name, tree)
    }
    modules = {}
    for name, tree in trees.items():
        if name.endswith("__init__"):
            continue
        targets = (
            _home(f"{module}.{imported}", trees, public)
            for module, imported, _ in _imported(name, tree)
        )
        imports = frozenset(target for target in targets if target not in (None, name))
        modules[name] = Module(name, paths[name], texts[name], tree, imports)
    return modules


def _imported(importer: str, tree: ast.Module) -> list[tuple[str, str, str]]:
    """Module, name in it, and local name of every import of the project's own in a file."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(each.name, "", each.asname or each.name) for each in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = ".".join(importer.split(".")[: -node.level]) if node.level else ""
            module = ".".join(filter(None, (above, node.module)))
            found += [(module, each.name, each.asname or each.name) for each in node.names]
    return [each for each in found if each[0].split(".")[0] == "ripple_sim"]


def _home(name: str, trees: dict[str, ast.Module], public: dict[str, str]) -> str | None:
    """The module that an imported name is, or comes from; None for a package itself."""
    while name in public:
        name = public[name]
    name = name.rstrip(".")
    while name:
        if name in trees:
            return name
        name = name.rpartition(".")[0]
        if f"{name}.__init__" in trees:
            return None
    return None


def room(name: str) -> str:
    """Name as in the folder listing: ripple_sim/coupling/, ripple_sim/simulation.py."""
    depth = 3 if name.startswith("ripple_sim.solver.") else 2
    return ".".join(name.split(".")[:depth])


def grouped(modules: dict[str, Module], group: dict[str, str]) -> dict[str, set[str]]:
    """Imports between groups of modules, given each module's group; none within a group."""
    arrows: dict[str, set[str]] = {each: set() for each in group.values()}
    for name, module in modules.items():
        for imported in module.imports:
            if name in group and imported in group and group[name] != group[imported]:
                arrows[group[name]].add(group[imported])
    return arrows


def cycles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Sets of nodes that reach one another: Tarjan's strongly connected components."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        order[node] = low[node] = len(order)
        stack.append(node)
        for other in sorted(arrows.get(node, ())):
            if other not in order:
                visit(other)
            if other in stack:
                low[node] = min(low[node], low[other])
        if low[node] == order[node]:
            component = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(arrows):
        if node not in order:
            visit(node)
    return found
