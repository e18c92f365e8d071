"""Documentation: every block of code and command runs, and every file exists.

Blocks of a page run in their order, in one folder and one Python namespace, as a reader would type
them. A block with a title is a file of that name. TOML without a title is added to the page's last
scene file, or, where the page has none, is a scene file of its own. Clips are small and short,
whatever size the page asks for.
"""

import importlib.util
import os
import re
import shlex
import sys
import tomllib
import types
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import pytest
from stand_in_physics import stand_in_suite

from ripple_sim.batch import Variation, read_plan
from ripple_sim.cli import COMMANDS, parse
from ripple_sim.cli.main import main
from ripple_sim.scene import load_scene
from ripple_sim.scenes.shapes import peanut, write_obj

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

SMALL = {"--size": "64x48", "--duration": "0.1", "--resolution": "16", "--fps": "10"}
CLIPS = ("render", "drop", "export")  # commands that take a size
WINDOWS = ("view", "bench")  # commands that would stay open
OTHERS = ("ssh", "python3.11", "export")  # programs that are not ours

# What the pages call a model of one's own: the geoms of their examples.
MODEL = """<mujoco><worldbody>
  <geom name="floor" type="plane" size="2 2 1"/>
  <geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" pos="0 0 0.3"/>
  <site name="side" pos="0.4 0 0.3"/>
  <body name="ball" pos="0.1 0 1"><freejoint/><geom size="0.06"/></body>
  <body name="torso" pos="2 0 1"><freejoint/><geom name="torso" type="box" size="0.2 0.1 0.1"/>
  </body>
  <body name="head" pos="4 0 1"><freejoint/>
    <geom name="head" type="sphere" size="0.2" contype="0" conaffinity="0" mass="0"/>
    <geom name="hull0" type="sphere" size="0.19" pos="0.01 0 0" mass="5"/>
    <geom name="hull1" type="sphere" size="0.19" mass="5"/></body>
</worldbody></mujoco>"""


class Block(NamedTuple):
    """A fenced block of a page."""

    line: int
    language: str
    title: str | None
    text: str


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    found = re.finditer(r'^```(\w*)(?: title="(.*?)")?\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)
    return [Block(text.count("\n", 0, m.start()) + 1, *m.groups()) for m in found]


def commands(page: Path) -> list[str]:
    return re.findall(r"`((?:ripple-sim|python|pytest) [^`\n]+)`", page.read_text(encoding="utf-8"))


def named(pages: list[Path]) -> list[Any]:
    return [pytest.param(page, id=page.name) for page in pages]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A reader's folder: a mesh and a model of one's own, and a copy of the shipped scenes."""
    monkeypatch.chdir(tmp_path)
    if importlib.util.find_spec("dm_control") is None:
        suite = stand_in_suite(MODEL)
        package = types.ModuleType("dm_control")
        package.suite = suite  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "dm_control", package)
        monkeypatch.setitem(sys.modules, "dm_control.suite", suite)
    monkeypatch.setenv("MUJOCO_GL", os.environ.get("MUJOCO_GL", "disable"))  # the program sets it
    write_obj(tmp_path / "my_mesh.obj", *peanut())
    (tmp_path / "scene.xml").write_text(MODEL)
    for path in [*(ROOT / "scenes").glob("*.xml"), ROOT / "scenes" / "meshes"]:
        (tmp_path / path.name).symlink_to(path)
    return tmp_path


class Reader:
    """Types in the blocks of a page."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "page"}
        self.scene: Path | None = None

    def take(self, block: Block) -> None:
        if block.title is not None:
            (self.folder / block.title).write_text(block.text)
        getattr(self, f"_{block.language or 'plain'}")(block)

    def _python(self, block: Block) -> None:
        if "import gymnasium" in block.text:
            pytest.importorskip("gymnasium")
        exec(compile("\n" * block.line + block.text, "page", "exec"), self.names)

    def _xml(self, block: Block) -> None:
        if block.title is None:
            mujoco.MjModel.from_xml_string(block.text)
        else:
            mujoco.MjModel.from_xml_path(str(self.folder / block.title))

    def _toml(self, block: Block) -> None:
        if block.title is not None and block.title.startswith("plan"):
            path = self.folder / block.title
            Variation(read_plan(path), 0).load()
            small = "size = [64, 48]\nfps = 10\nduration = 0.2"
            path.write_text(re.sub(r"size = .*\nfps = .*\nduration = .*", small, block.text))
            return
        if block.title is not None:
            self.scene = self.folder / block.title
        elif self.scene is not None:
            self.scene.write_text(self.scene.read_text() + "\n" + block.text)
        whole = self.scene or self.folder / "page.toml"
        if self.scene is None:
            model = "" if "model" in tomllib.loads(block.text) else 'model = "scene.xml"\n'
            whole.write_text(model + block.text)
        load_scene(whole)

    def _sh(self, block: Block) -> None:
        for line in block.text.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words:
                self._command(words)

    def _plain(self, block: Block) -> None:
        """A drawing, or what a program printed."""

    def _command(self, words: list[str]) -> None:
        program, *rest = words
        if program == "make":
            assert re.search(rf"^{rest[0]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
        elif Path(program).name == "pip":
            extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
                "optional-dependencies"
            ]
            assert set(re.findall(r"\[(\w+)\]", rest[-1])) <= set(extras)
        elif Path(program).name == "python":
            assert (ROOT / rest[0]).is_file()
        elif Path(program).name == "ripple-sim":
            assert parse(rest) is not None
            # pictures: scenes run in other tests; Blender is on few machines
            elsewhere = rest[0] in WINDOWS or "cycles" in rest or "docs/pictures" in " ".join(rest)
            if not elsewhere:
                assert main(small(rest)) == 0
        else:
            assert program in OTHERS


def small(words: list[str]) -> list[str]:
    """The words of a command, with a small size for a clip."""
    if words[0] == "batch":
        return [*words, "--limit", "1", "--workers", "1", "--keep-free", "0.01"]
    if words[0] not in CLIPS:
        return [*words, "--resolution", "16"] if words[0] == "atlas" else words
    kept = [
        word
        for i, word in enumerate(words)
        if word not in SMALL and (i == 0 or words[i - 1] not in SMALL)
    ]
    return [*kept, *(word for option in SMALL.items() for word in option)]


@pytest.mark.filterwarnings("error::ripple_sim.errors.RippleWarning")
@pytest.mark.parametrize(
    "page", named([page for page in PAGES if any(b.language for b in blocks(page))])
)
def test_the_code_of_a_page_runs_from_top_to_bottom(opengl: None, page: Path, folder: Path) -> None:
    reader = Reader(folder)
    for block in blocks(page):
        try:
            reader.take(block)
        except Exception as error:
            error.add_note(f"{page.name}, line {block.line}")
            raise


@pytest.mark.parametrize("page", named([page for page in PAGES if commands(page)]))
def test_the_commands_in_the_text_of_a_page_are_understood(page: Path) -> None:
    for command in commands(page):
        program, *words = shlex.split(re.sub(r"\[.*?\]|\.\.\.", "", command))
        if program == "ripple-sim" and len(words) == 1:
            assert words[0] in COMMANDS, command
        elif program == "ripple-sim":
            assert parse(words) is not None or words[0] == "completion", command
        for word in words:
            if word.startswith(("examples/", "tests/", "scenes/")):
                assert (ROOT / word).exists(), f"{page.name}: {command}"


def test_own_loop_is_short() -> None:
    # the README promises ten lines beside the model itself
    code = next(block.text for block in blocks(ROOT / "README.md") if block.language == "python")
    own = re.sub(r'model = .*?"""\)\n', "", code, flags=re.DOTALL)
    assert len([line for line in own.splitlines() if line.strip()]) <= 10
