"""The walk of docs/architecture.md: the modules that a physics step with one contact runs.

    python examples/plots/structure.py [--docs]

prints the walk; with --docs it writes it into the page, between the marks.
"""

import argparse
import ast
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from imports import ROOT

PAGE = ROOT / "docs" / "architecture.md"

# A ball lies on a sphere. The modules are listed in the order in which the step first enters them.
# Kernels run as plain Python, so that the trace sees their modules too.
TRACE = """
import json, sys
import mujoco
from ripple_sim import Material, Ripples
model = mujoco.MjModel.from_xml_string('''<mujoco><visual><global offwidth="160" offheight="90"/>
</visual><worldbody>
  <light pos="1 1 3" dir="-.3 -.3 -1"/><geom name="floor" type="plane" size="2 2 1"/>
  <geom name="target" size="0.3" pos="0 0 0.3"/>
  <body pos="0.02 0 0.655"><freejoint/><geom size="0.06"/></body></worldbody></mujoco>''')
data = mujoco.MjData(model)
material = Material(speed=0.6, damping=1.0, density=600.0)
ripples = Ripples(model, {"target": material}, resolution=8, backend="cpu")
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
print(json.dumps(traced(ripples.step)))
"""


def walk() -> list[str]:
    """The modules that a step with a contact runs, as paths in the source tree."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", TRACE],
        capture_output=True,
        text=True,
        env=environment,
        cwd=ROOT,
    )
    if done.returncode:
        sys.exit(
            f"{sys.executable} cannot trace a step: {done.stderr.strip().splitlines()[-1]}; run "
            "this with the Python in which ripple-sim is installed, such as .venv/bin/python"
        )
    paths = json.loads(done.stdout.splitlines()[-1])
    roots = {(ROOT / folder).resolve(): folder for folder in ("solver", "ripple_sim")}
    return [
        f"{folder}/{Path(path).resolve().relative_to(root)}"
        for path in paths
        for root, folder in roots.items()
        if Path(path).resolve().is_relative_to(root) and not path.endswith("__init__.py")
    ]


def walk_in_words(paths: Iterable[str]) -> str:
    """A numbered list: each module, and what it says of itself."""
    lines = []
    for number, path in enumerate(paths, 1):
        text = ast.get_docstring(ast.parse((ROOT / path).read_text(encoding="utf-8"))) or ""
        lines.append(f"{number}. `{path}`: {' '.join(text.split(chr(10) * 2)[0].split())}")
    return "\n".join(lines)


def replaced(page: str, mark: str, text: str) -> str:
    """The page with a text between the marks of a name."""
    start = f"<!-- {mark} -->"
    end = f"<!-- end of {mark} -->"
    before, _, rest = page.partition(start)
    return f"{before}{start}\n{text}\n{end}{rest.partition(end)[2]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--docs", action="store_true", help="write the walk into the documentation")
    arguments = parser.parse_args()
    words = walk_in_words(walk())
    if arguments.docs:
        PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), "walk", words), encoding="utf-8")
    else:
        print(words)


if __name__ == "__main__":
    main()
