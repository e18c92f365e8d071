"""The report of an atlas: figures of a mesh that are known, as JSON and as text."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from ripple_sim.cli.atlas import atlas_report, report_text
from ripple_sim.solver import Atlas, Mesh, build_atlas


@pytest.fixture(scope="module")
def box() -> Atlas:
    made = trimesh.creation.box((2.0, 1.0, 0.5)).subdivide().subdivide()
    return build_atlas(Mesh.from_arrays(np.array(made.vertices), np.array(made.faces)), 8, cache=False)


def test_the_figures_of_a_box_are_those_of_its_sides_and_survive_json(box: Atlas) -> None:
    report = atlas_report(Path("box.obj"), box, "direct", {"sphere_map": 0.25})
    assert report == json.loads(json.dumps(report))
    assert report["size"] == pytest.approx([2.0, 1.0, 0.5])
    assert report["area"] == pytest.approx(2 * (2 + 1 + 0.5))
    assert report["volume"] == pytest.approx(1.0)
    assert report["vertices"] - report["triangles"] / 2 == 2  # Euler, of a sphere
    assert (report["mesh"], report["resolution"], report["method"], report["notes"]) == ("box.obj", 8, "direct", [])


def test_the_text_has_a_line_for_every_figure_with_values_in_one_column(box: Atlas) -> None:
    report = atlas_report(Path("box.obj"), box, "direct", {"sphere_map": 0.25, "texels": 1.0})
    report["notes"] = ["2 vertices merged", "orientation reversed"]
    title, *lines = report_text(report).splitlines()
    assert title == "box.obj"
    assert "size" in lines[1]
    assert "2 x 1 x 0.5 m" in lines[1]
    assert [line.split(None, 1)[1] for line in lines if line.startswith("note")] == report["notes"]
    assert any(line.startswith("sphere map time") and line.endswith("0.250 s") for line in lines)
    assert any("6 x 8 x 8 texels, direct sphere map" in line for line in lines)
    assert len(lines) == 4 + 2 + 1 + len(report["quality"]) + 2
    assert any(line.startswith("longest texel edge ") and line.endswith(" m") for line in lines)
    width = min(line.rindex("  ") for line in lines if line.startswith("area starved"))
    assert all(line[width : width + 2] == "  " and line[width + 2] != " " for line in lines)


def test_the_patches_of_an_open_mesh_are_counted_and_have_no_sphere_map() -> None:
    bowl = trimesh.creation.box((2.0, 1.0, 0.5)).subdivide()
    atlas = build_atlas(Mesh.from_arrays(np.array(bowl.vertices), np.array(bowl.faces)[:-8]), 12, cache=False)
    report = atlas_report(Path("bowl.obj"), atlas, "progressive", {})
    charts, n, _ = atlas.texels.shape
    assert (report["layout"], report["method"], report["charts"]) == ("patches", None, [charts, n, n])
    assert f"{charts} x {n} x {n} texels, patches" in report_text(report)
