"""How much of the source a reader has to hold: counts, and the modules that a contact and a frame pass.

    python examples/plots/structure.py [--docs]

prints the tables of docs/architecture.md; with --docs it writes them there, between the marks, and keeps the column of
the older version as it is.
"""

import argparse
import ast
import json
import os
import re
import statistics
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from imports import FOLDERS, ROOT, Module, cycles, read

PAGE = ROOT / "docs" / "architecture.md"
MOST_MODULES, MOST_LINES, MOST_WITH_ONE_IMPORTER = 260, 450, 0.20  # what tests/docs/test_architecture.py allows

# A ball lies on a sphere: what a step and a frame run, in the order in which it is first entered. Kernels run as plain
# Python, so that their modules are seen, too.
TRACE = """
import json, sys
import mujoco
from ripple_sim import Material, RippleRenderer, Ripples
model = mujoco.MjModel.from_xml_string('''<mujoco><visual><global offwidth="160" offheight="90"/></visual><worldbody>
  <light pos="1 1 3" dir="-.3 -.3 -1"/><geom name="floor" type="plane" size="2 2 1"/>
  <geom name="target" size="0.3" pos="0 0 0.3"/>
  <body pos="0.02 0 0.655"><freejoint/><geom size="0.06"/></body></worldbody></mujoco>''')
data = mujoco.MjData(model)
ripples = Ripples(model, {"target": Material(speed=0.6, damping=1.0, density=600.0)}, resolution=8, backend="cpu")
seen = {}
def trace(frame, event, argument):
    if event == "call":
        seen.setdefault(frame.f_code.co_filename)
def traced(call):
    seen.clear()
    sys.setprofile(trace)
    call(data)
    sys.setprofile(None)
    return list(seen)
while not ripples.last_impulses:
    ripples.mj_step(data)
mujoco.mj_step(model, data)
found = {"step": traced(ripples.step)}
if "frame" in sys.argv:
    renderer = RippleRenderer(model, ripples, width=160, height=90)
    renderer.render(data)
    ripples.mj_step(data)
    found["frame"] = traced(renderer.render)
print(json.dumps(found))
"""


def counts(root: Path = ROOT) -> dict[str, str]:
    """Figures of a source tree, in words; `scenes/`, whose Python makes meshes, is left out."""
    modules = {name: each for name, each in read(root).items() if not name.startswith(f"{FOLDERS['scenes']}.")}
    lines = {name: each.text.count("\n") for name, each in modules.items()}
    longest = max(lines, key=lambda name: lines[name])
    nodes = [node for each in modules.values() for node in ast.walk(each.tree)]
    kernels = sum(isinstance(node, ast.FunctionDef) and _is_kernel(node) for node in nodes)
    files = {suffix: _texts(root, ("ripple_sim", "solver"), f"*.{suffix}") for suffix in ("glsl", "js")}
    tests = _texts(root, ("tests",), "*.py")
    imports = {name: set(each.imports) & set(modules) for name, each in modules.items()}
    return {
        "modules": f"{len(modules)}",
        "folders with Python": f"{len({each.path.parent for each in modules.values()})}",
        "lines of Python": f"{sum(lines.values()):,}",
        "median module, longest": f"{statistics.median(lines.values()):.0f}, {lines[longest]} lines",
        "modules under 40 lines": f"{sum(count < 40 for count in lines.values())}",
        "modules that exactly one other imports": f"{100 * with_one_importer(modules):.0f} %",
        "classes": f"{sum(isinstance(node, ast.ClassDef) for node in nodes)}",
        "kernels": f"{kernels}",
        "GLSL": f"{len(files['glsl'])} files, {_lines(files['glsl']):,} lines",
        "JavaScript": f"{len(files['js'])} files, {_lines(files['js']):,} lines",
        "tests": f"{len(tests)} files, {_lines(tests):,} lines",
        "cycles of modules": f"{len(cycles(imports)) or 'none'}",
    }


def with_one_importer(modules: dict[str, Module]) -> float:
    """Share of the modules that exactly one other module imports, by whatever room's name."""
    importers = Counter(imported for each in modules.values() for imported in each.imports)
    return sum(importers[name] == 1 for name in modules) / len(modules)


def walks(*what: str) -> dict[str, list[str]]:
    """The modules that a step with a contact runs, and, asked for `"frame"`, those of a frame, as paths in the tree."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", TRACE, *what], capture_output=True, text=True, check=True, env=environment, cwd=ROOT
    )
    found = json.loads(done.stdout.splitlines()[-1])
    roots = {(ROOT / folder).resolve(): folder for folder in ("solver", "ripple_sim")}
    return {
        name: [
            f"{folder}/{Path(path).resolve().relative_to(root)}"
            for path in paths
            for root, folder in roots.items()
            if Path(path).resolve().is_relative_to(root) and not path.endswith("__init__.py")
        ]
        for name, paths in found.items()
    }


def walk_in_words(paths: Iterable[str]) -> str:
    """A numbered list: each module, and what it says of itself."""
    lines = []
    for number, path in enumerate(paths, 1):
        text = ast.get_docstring(ast.parse((ROOT / path).read_text(encoding="utf-8"))) or ""
        lines.append(f"{number}. `{path}`: {' '.join(text.split(chr(10) * 2)[0].split())}")
    return "\n".join(lines)


def table(older: dict[str, str], now: dict[str, str]) -> str:
    """The table of two versions."""
    rows = [f"| {name} | {older.get(name, '')} | {figure} |" for name, figure in now.items()]
    return "\n".join(["| measure | before | now |", "| --- | --- | --- |", *rows])


def older_figures(page: str) -> dict[str, str]:
    """The column of the older version, as the page has it."""
    rows = re.findall(r"^\| ([^|]+) \| ([^|]*) \| [^|]* \|$", page, re.MULTILINE)
    return {name.strip(): figure.strip() for name, figure in rows}


def replaced(page: str, mark: str, text: str) -> str:
    """The page with a text between the marks of a name."""
    start, end = f"<!-- {mark} -->", f"<!-- end of {mark} -->"
    before, _, rest = page.partition(start)
    return f"{before}{start}\n{text}\n{end}{rest.partition(end)[2]}"


def _is_kernel(node: ast.FunctionDef) -> bool:
    return any(word in ast.unparse(each) for each in node.decorator_list for word in ("kernel", "njit", "numba"))


def _texts(root: Path, folders: Iterable[str], pattern: str) -> list[str]:
    return [path.read_text(encoding="utf-8") for folder in folders for path in sorted((root / folder).rglob(pattern))]


def _lines(texts: Iterable[str]) -> int:
    return sum(text.count("\n") for text in texts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--docs", action="store_true", help="write the tables into the documentation")
    page, found = PAGE.read_text(encoding="utf-8"), walks("frame")
    now = counts()
    now["modules run by a step with a contact"] = f"{len(found['step'])}"
    now["modules whose Python runs in a frame"] = f"{len(found['frame'])}"
    page = replaced(page, "counts", table(older_figures(page), now))
    page = replaced(page, "walk", walk_in_words(found["step"]))
    if parser.parse_args().docs:
        PAGE.write_text(page, encoding="utf-8")
    else:
        print(table(older_figures(page), now), walk_in_words(found["step"]), sep="\n\n")


if __name__ == "__main__":
    main()
