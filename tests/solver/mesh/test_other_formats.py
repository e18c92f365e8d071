"""Formats that assimp reads, in a process of its own."""

from pathlib import Path

import numpy as np
import pytest
from gltf_files import png

from ripple_sim.solver import MeshError, load_mesh
from ripple_sim.solver.mesh.formats import other
from ripple_sim.solver.mesh.formats.other import ASSIMP_ENDINGS

# a square that lies in the plane of x and z, with y up
X3D = """<?xml version="1.0"?><X3D version="3.3"><Scene><Transform translation="5 0 0">
<Shape><Appearance><Material diffuseColor="0 0 1"/></Appearance>
<IndexedFaceSet coordIndex="0 1 2 3 -1">
<Coordinate point="0 0 0 0 0 1 1 0 1 1 0 0"/></IndexedFaceSet>
</Shape></Transform></Scene></X3D>"""

DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"
version="1.4.1"><asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>a%20b.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><lambert><diffuse><texture texture="t" texcoord="UV"/></diffuse></lambert>
</technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 0 1</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<source id="u"><float_array id="ua" count="6">0 0 1 0 0 1</float_array><technique_common>
<accessor source="#ua" count="3" stride="2"><param name="S" type="float"/>
<param name="T" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="M"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="0" set="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="sc"><node><instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="M" target="#m"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#sc"/></scene></COLLADA>"""


@pytest.fixture(autouse=True)
def _with_assimp() -> None:
    pytest.importorskip("assimp_py")


def test_what_is_not_shown_of_a_material_is_named(tmp_path: Path) -> None:
    bump = '<bump><texture texture="t" texcoord="UV"/></bump>'
    extra = f'<extra><technique profile="FCOLLADA">{bump}</technique></extra>'
    (tmp_path / "a b.png").write_bytes(png([[[255, 0, 0]]]))
    end = "</technique></profile_COMMON>"
    (tmp_path / "a.dae").write_text(DAE.replace(end, extra + end))
    mesh = load_mesh(tmp_path / "a.dae")
    assert mesh.looks.notes == ("not shown of its materials: normal maps",)


def test_x3d_has_its_transforms_and_colours(tmp_path: Path) -> None:
    (tmp_path / "a.x3d").write_text(X3D)
    mesh = load_mesh(tmp_path / "a.x3d")
    assert (mesh.V[:, 0].min(), mesh.V[:, 0].max(), mesh.area) == (5, 6, pytest.approx(1))
    assert {mesh.looks.paints[number].color for number in mesh.looks.paint} == {(0, 0, 1, 1)}


def test_collada_has_its_up_axis_its_image_and_its_coordinates(tmp_path: Path) -> None:
    (tmp_path / "a b.png").write_bytes(png([[[255, 0, 0]]]))
    (tmp_path / "a.dae").write_text(DAE)
    mesh = load_mesh(tmp_path / "a.dae")
    # z up in the file is y up in the mesh
    assert np.ptp(mesh.V, axis=0).round(6).tolist() == [1, 1, 0]
    (number,) = np.unique(mesh.looks.paint)
    assert mesh.looks.paints[number].image.source == tmp_path / "a b.png"
    np.testing.assert_allclose(mesh.corner_uv, mesh.V[mesh.F][..., :2], atol=1e-6)


@pytest.mark.parametrize("ending", [".fbx", ".dae", ".3ds"])
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"a{ending}").write_bytes(b"no such file")
    with pytest.raises(MeshError, match=r"a\.\w+' cannot be read: assimp cannot read it: [^\n]+$"):
        load_mesh(tmp_path / f"a{ending}")


def test_without_the_package_its_command_is_named(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(other.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(other.trimesh, "available_formats", set)
    for ending in ASSIMP_ENDINGS[:2]:
        (tmp_path / f"a{ending}").write_bytes(b"x")
        with pytest.raises(MeshError, match=r"need the package assimp-py: run pip install 'ripple"):
            load_mesh(tmp_path / f"a{ending}")


def test_units_opacity_and_emission_are_those_of_the_file(tmp_path: Path) -> None:
    extents = []
    for unit in ("1", "0.01"):
        (tmp_path / "a.dae").write_text(DAE.replace('meter="1"', f'meter="{unit}"'))
        extents.append(np.ptp(load_mesh(tmp_path / "a.dae").V))
    assert extents == pytest.approx([1, 0.01])
    material = '<Material diffuseColor="0 0 1" emissiveColor="0 1 0" transparency="0.25"/>'
    (tmp_path / "a.x3d").write_text(X3D.replace('<Material diffuseColor="0 0 1"/>', material))
    (paint,) = load_mesh(tmp_path / "a.x3d").looks.paints
    assert (paint.emission, paint.alpha) == ((0, 1, 0), "blend")
    assert paint.color == pytest.approx((0, 0, 1, 0.75))
