"""The plots of examples/plots, made small: each writes its picture."""

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

FOLDER = Path(__file__).parents[2] / "examples" / "plots"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("wave_fronts", {"resolution": 16, "size": 40}),
        ("energy", {"steps": 200, "resolution": 16}),
        ("convergence", {"resolutions": (8, 12)}),
        ("dispersion", {"texels": 24}),
        ("decay", {"texels": 24}),
        ("gelatine_ring", {"texels": 24}),
    ],
)
def test_plot_is_written(name: str, options: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))
    path = importlib.import_module(name).make(tmp_path, **options)
    for module in (name, "figure", "standing_wave"):
        sys.modules.pop(module, None)
    picture = np.asarray(Image.open(path).convert("RGB"))
    assert picture.shape[1] > 900
    assert picture.std() > 10
