"""`ripple-sim modes`: its table, its picture, its refusals."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from ripple_sim.cli import main as cli
from ripple_sim.figures import atlas_painter, mode_plot

SHEET = "v 0 0 0\nv 0.5 0 0\nv 1 0 0\nv 0 0 1\nv 0.5 0 1\nv 1 0 1\nf 1 4 5 2\nf 2 5 6 3\n"


def test_modes_of_a_sheet_with_a_fixed_rim_are_printed_and_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(atlas_painter, "OVERSAMPLING", 1)
    monkeypatch.setattr(mode_plot, "_MAX_PICTURE_SIZE", 64)
    mesh = tmp_path / "sheet.obj"
    plot = tmp_path / "modes.png"
    mesh.write_text(SHEET)
    argv = [
        "modes",
        str(mesh),
        "--material",
        "membrane,tension=9,damping=0.5",
        "-n",
        "6",
        "--resolution",
        "8",
    ]
    assert cli.main([*argv, "--rim", "fixed", "--plot", str(plot), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    exact = np.sqrt([2, 5, 5, 8, 10, 10])
    np.testing.assert_allclose([mode["ratio"] for mode in told], exact / exact[0], rtol=0.05)
    np.testing.assert_allclose([mode["frequency"] for mode in told], 1.5 * exact, rtol=0.07)
    np.testing.assert_allclose([mode["decay_time"] for mode in told], 4.0)
    pixels = np.asarray(Image.open(plot).convert("RGB"), dtype=float)
    assert pixels.shape == (1080, 1920, 3)
    redness = pixels[..., 0] - pixels[..., 2]
    assert (redness[200:500, 100:600] > 100).any() and (redness[200:, :] < -80).any()
    assert cli.main([*argv, "--rim", "free"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 7
    assert re.fullmatch(r" +1 +1\.\d+ +1 +4", rows[1])


@pytest.mark.parametrize(
    ("material", "said"),
    [
        ("foam", "preset must be one of membrane"),
        ("plate,width=2", "no parameter 'width'; its parameters are modulus, thickness"),
        ("plate,thickness", "steel-plate,thickness=0.002"),
        ("layer,modulus=-1", "modulus must be a finite number greater than 0, got -1.0 Pa"),
        ("membrane,density=1 --count=99", "must be a whole number from 1 to"),
    ],
)
def test_invalid_materials_and_counts_are_refused(refusal, tetrahedron, material, said):
    material, *more = material.split(" ")
    argv = ("modes", str(tetrahedron), "--material", material, "--resolution", "4", *more)
    assert said in refusal(*argv)
    assert "the mesh itself" in refusal(
        "modes", str(tetrahedron), "--material", "plate", "--plot", str(tetrahedron)
    )
