"""The runs of a comparison."""

import pytest

from ripple_sim.errors import SceneError
from ripple_sim.overlay.notes import compared_operators


def test_comparison_names_its_baselines() -> None:
    assert compared_operators(None) == ("fem",)
    assert compared_operators("paper") == ("fem", "paper")
    with pytest.raises(SceneError, match="paper, uncorrected, dynamic-paint"):
        compared_operators("fem")
