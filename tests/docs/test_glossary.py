"""The code keeps to the words of docs/glossary.md: words that it has given up appear in no name.

Names are all identifiers of Python and GLSL files and the names of the files themselves, taken
apart into words at underscores and capitals. To retire a word, add it to INSTEAD; where it means
something else, say so in ALLOWED.
"""

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"

# each entry is the word to use, and after the colon the retired words
INSTEAD = """height map: relief reliefs; footprint cache: footing; reusable: used_before;
reach: hovering;
scratch: nowhere everywhere_infinite; contact load: felt press presses pressed;
deficit: owed owing debt;
unsupported: undrawn; visual: piece pieces; transparent visual: clear_body; halo: ring padded;
movable: carries carried;
tunnelling: speed_check check_speeds; flex collider: shell shells; target: ripple_surface;
ripple renderer: pictures;
shutter times: moments; render settings: job; double buffering: pipeline; prefetch: ahead;
resources: owned;
octahedral encoding: folded unfolded; unpack: parted; tone mapping: development developed;
shadow bias: lift"""
RETIRED = {
    word: each.split(":")[0]
    for each in re.split(r";\s", INSTEAD)
    for word in each.split(":")[1].split()
}

# Retired words that stay: the beginning of the path, the words, and why.
ALLOWED = [
    ("solver/layouts/", "ring", "the one-ring of a vertex"),
    (
        "solver/layouts/sphere_map/",
        "carried",
        "area of collapsed vertices, which the kept ones stand for",
    ),
    ("solver/layouts/", "ahead", "a trial step of the descent"),
    ("solver/layouts/", "folded", "a triangle or a texel that the map turns over"),
    ("solver/texels/texel_quality.py", "folded", "a texel whose neighbours turn over"),
    ("solver/mesh/", "folded", "a polygon that turns over"),
    ("solver/", "piece pieces", "parts of a triangle, cut at the edges of the cube"),
    ("ripple_sim/cli/", "shell", "bash, zsh, fish"),
    (
        "ripple_sim/coupling/",
        "shell",
        "MuJoCo's: the outside of a soft flex, and the inertia of a hollow mesh",
    ),
    ("ripple_sim/scene/bodies", "shell", "likewise"),
    ("ripple_sim/render/", "shell", "the round outside of a primitive, sized apart from its core"),
    ("ripple_sim/video/", "ahead", "how many frames one stage may be in front of the next"),
    ("ripple_sim/viewer/", "press pressed", "a key or a button"),
    ("solver/waves/", "press press_to", "the public call: a body pressed into a surface"),
]


def names(path: Path) -> Iterator[str]:
    """Every identifier of a file, and the file's own name."""
    yield path.stem
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.NAME:
                yield token.string
    else:
        yield from re.findall(
            r"[A-Za-z_]\w*", re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
        )


def words(name: str) -> str:
    """The words of a name, in lower case, each between underscores: ClearBody is _clear_body_."""
    return (
        "_"
        + "_".join(each.lower() for each in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name))
        + "_"
    )


def test_no_name_has_a_retired_word() -> None:
    found = set()
    for folder in ("ripple_sim", "solver", "scenes"):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix not in (".py", ".glsl"):
                continue
            place = path.relative_to(ROOT).as_posix()
            for name in set(names(path)):
                for word in re.findall("(?<=_)(?:" + "|".join(RETIRED) + ")(?=_)", words(name)):
                    if not any(
                        place.startswith(start) and word in stays.split()
                        for start, stays, _ in ALLOWED
                    ):
                        found.add(f"{place}: {name} (say {RETIRED[word]})")
    assert not found, "\n".join(
        ["names with words that docs/glossary.md has given up:", *sorted(found)]
    )


def test_the_glossary_has_the_replacements_of_retired_words() -> None:
    page = GLOSSARY.read_text(encoding="utf-8").lower()
    names_in_code = {"unpack", "reusable"}  # of functions, which need no entry
    phrases = {instead.removesuffix("s") for instead in RETIRED.values()} - names_in_code
    assert not [each for each in phrases if each not in page]


def test_every_entry_of_the_glossary_is_explained_and_in_order() -> None:
    entries = []
    section = ""
    for line in GLOSSARY.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            section = line
        if line.startswith("| **"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            assert len(cells) == 3, line
            assert len(cells[1].split()) >= 4, line
            entries.append((section, re.sub(r"[^a-z -]", "", cells[0].lower())))
    assert len(entries) > 80
    assert len({name for _, name in entries}) == len(entries)
    for section in {section for section, _ in entries}:
        inside = [name for each, name in entries if each == section]
        assert inside == sorted(inside), section
