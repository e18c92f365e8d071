"""The figure of an atlas."""

import numpy as np
import pytest

from ripple_sim.figures.atlas_plot import plot_atlas
from ripple_sim.figures.atlas_view import AtlasPainter
from ripple_sim.solver import AtlasError


def test_a_full_disk_is_one_line(monkeypatch, tmp_path, animal):
    def full(self, path, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(AtlasPainter, "mesh", lambda self, view, size: np.zeros((4, 4, 4)))
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    with pytest.raises(AtlasError, match="No space left"):
        plot_atlas(animal, tmp_path / "atlas.png", title="animal")
