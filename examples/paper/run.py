"""The paper, part by part, on one page.

python examples/paper/run.py

Writes out/paper/index.html with its pictures, and with --docs also docs/paper.md; each part also
runs alone. The paper is by Kira, Nakayama and Fujishiro (The Journal of the Society for Art and
Science).
"""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

from page import Part, write_markdown, write_page

FOLDER = Path("out/paper")
PARTS = (
    "figure_1",
    "figure_2",
    "section_4_1",
    "figure_5",
    "figures_6_7",
    "figure_8",
    "section_6_4",
    "table_1",
)
TITLE = "The paper, part by part"
LEAD = (
    "This page repeats the figures of Kira, Nakayama and Fujishiro, "
    '"Jacobian-free Deformation of Genus-0 Surfaces", with other objects. '
    "`python examples/paper/run.py` draws and measures all of them."
)


def alone(make: Callable[[Path], Part]) -> None:
    """Make one part and print what it found."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    part = make(FOLDER)
    print(f"{part.title}\n{part.text}")
    for row in part.table:
        print("  ".join(row))
    for file, _ in part.pictures:
        print(file)


def main() -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    parts = []
    for name in PARTS:
        print(name, file=sys.stderr)
        parts.append(
            (f"python examples/paper/{name}.py", importlib.import_module(name).make(FOLDER))
        )
    page = FOLDER / "index.html"
    write_page(page, TITLE, LEAD, parts)
    if "--docs" in sys.argv[1:]:
        write_markdown(Path("docs/paper.md"), TITLE, LEAD, parts)
    print(page)


if __name__ == "__main__":
    main()
