"""Measures of the source tree: modules, functions, imports, cycles, tests and copies.

    python examples/plots/structure.py [TREE ...]

prints one column for each tree, such as a checkout of an earlier version and this one.
"""

import ast
import io
import statistics
import sys
import tokenize
from collections import defaultdict
from pathlib import Path

from imports import ROOT, Module, cycles, grouped, read

COPY = 40  # tokens: what is repeated at this length or more counts as a copy


def measure(root: Path) -> dict[str, str]:
    modules = read(root)
    lines = {name: module.text.count("\n") for name, module in modules.items()}
    functions = [each for module in modules.values() for each in _functions(module)]
    longest = max(lines, key=lambda name: lines[name])
    function = max(functions, key=lambda each: each[1])
    widest = max(functions, key=lambda each: each[2])
    packages = grouped(modules, {name: module.package for name, module in modules.items()})
    rooms = grouped(modules, {name: room(name) for name in modules})
    tests = sum(path.read_text(encoding="utf-8").count("\n") for path in (root / "tests").rglob("*.py"))
    return {
        "modules": str(len(modules)),
        "lines of code": f"{sum(lines.values()):,}",
        "median module": f"{statistics.median(lines.values()):.0f} lines",
        "longest module": f"{lines[longest]} lines ({_short(longest)})",
        "modules over 150 lines": str(sum(count > 150 for count in lines.values())),
        "longest function": f"{function[1]} lines ({_short(function[0])})",
        "functions over 60 lines": str(sum(each[1] > 60 for each in functions)),
        "most parameters": f"{widest[2]} ({_short(widest[0])})",
        "functions of over 8 parameters": str(sum(each[2] > 8 for each in functions)),
        "rooms, arrows between them": f"{len(rooms)}, {_count(rooms)}",
        "packages, arrows between them": f"{len(packages)}, {_count(packages)}",
        "arrows between modules": str(sum(len(module.imports) for module in modules.values())),
        "cycles of neighbours in a folder": _named(_folder_cycles(modules)),
        "cycles of modules": _named(cycles({name: set(module.imports) for name, module in modules.items()})),
        "tests / code": f"{tests / sum(lines.values()):.2f}",
        f"code that stands twice, {COPY} tokens or more": f"{100 * _copied(modules):.1f} %",
    }


def room(name: str) -> str:
    """What a newcomer sees in the folder listing: ripple_sim/coupling/, solver/waves/, ripple_sim/simulation.py."""
    depth = 3 if name.startswith("ripple_sim.solver.") else 2
    return ".".join(name.split(".")[:depth])


def _functions(module: Module) -> list[tuple[str, int, int]]:
    """Name, lines and parameters (without self and cls) of every function."""
    found = []
    for node in ast.walk(module.tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            parameters = len([name for name in names if name not in ("self", "cls")])
            found.append((f"{module.name}.{node.name}", node.end_lineno - node.lineno + 1, parameters))
    return found


def _folder_cycles(modules: dict[str, Module]) -> list[list[str]]:
    """Cycles among the files and folders that lie side by side in one folder."""
    found = []
    folders = {name.rsplit(".", depth)[0] for name in modules for depth in range(1, name.count(".") + 1)}
    for folder in sorted(folders):
        depth = folder.count(".") + 2
        inside = {name: ".".join(name.split(".")[:depth]) for name in modules if name.startswith(f"{folder}.")}
        found += cycles(grouped(modules, inside))
    return found


def _copied(modules: dict[str, Module]) -> float:
    """Share of the tokens that stand in a sequence which is found twice or more; imports and comments left out."""
    texts = {name: _tokens(module) for name, module in modules.items()}
    places = defaultdict(list)
    for name, tokens in texts.items():
        for start in range(len(tokens) - COPY + 1):
            places[tuple(tokens[start : start + COPY])].append((name, start))
    covered = {
        (name, position)
        for found in places.values()
        if len(found) > 1
        for name, start in found
        for position in range(start, start + COPY)
    }
    return len(covered) / sum(map(len, texts.values()))


def _tokens(module: Module) -> list[str]:
    imported = {
        line
        for node in ast.walk(module.tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for line in range(node.lineno, node.end_lineno + 1)
    }
    kinds = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)
    return [
        token.string
        for token in tokenize.generate_tokens(io.StringIO(module.text).readline)
        if token.type in kinds and token.start[0] not in imported
    ]


def _count(arrows: dict[str, set[str]]) -> int:
    return sum(map(len, arrows.values()))


def _named(found: list[list[str]]) -> str:
    names = "; ".join(" - ".join(_short(name) for name in each) for each in found)
    return f"{len(found)}: {names}" if found else "none"


def _short(name: str) -> str:
    return name.removeprefix("ripple_sim.")


def main() -> None:
    trees = [Path(each) for each in sys.argv[1:]] or [ROOT]
    columns = [measure(tree) for tree in trees]
    print("| measure |" + "".join(f" {tree.resolve().name} |" for tree in trees))
    print("| --- |" + " --- |" * len(trees))
    for name in columns[0]:
        print(f"| {name} | " + " | ".join(column[name] for column in columns) + " |")


if __name__ == "__main__":
    main()
