"""The frequencies of plates in the documentation are those of a whole run of their benchmark, by today's operator."""

from pathlib import Path

import numpy as np
import pytest
from plates import PLATES, atlas_of, frequencies

DOCS = Path(__file__).parents[2] / "docs"
RUN = (DOCS / "runs" / "plates.txt").read_text(encoding="utf-8")


def test_the_printed_table_is_the_stored_run() -> None:
    assert f"```\n{RUN}```" in (DOCS / "validation.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name", ["free [Hz], NAFEMS FV12", "cantilever, lambda^2, Barton", "disk, clamped, lambda^2, Leissa"]
)
def test_the_stored_run_is_of_todays_operator(name: str) -> None:
    plate, lines = PLATES[name], RUN.splitlines()
    stored = (
        lines[next(i for i, line in enumerate(lines) if line.startswith(name)) + 1].removeprefix("  N = 32").split()
    )
    np.testing.assert_allclose(frequencies(plate, atlas_of(plate, 32)), np.array(stored, float), rtol=1e-3)
