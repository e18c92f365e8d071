"""Coefficients in compiled loops: a number stands for a field that has it everywhere."""

import numpy as np
import pytest

from ripple_sim.solver.backends.stencil_loops import row_of, value_at, value_in
from ripple_sim.solver.kernel import kernel


@kernel
def by_rows(x, charts, n):
    out = np.empty((charts, n, n), np.float32)
    for chart in range(charts):
        for r in range(n):
            row = row_of(x, chart, r)
            for c in range(n):
                out[chart, r, c] = value_in(row, c)
    return out


@kernel
def by_index(x, size):
    out = np.empty(size, np.float32)
    for i in range(size):
        out[i] = value_at(x, i)
    return out


def test_a_field_is_read_texel_by_texel() -> None:
    field = np.random.default_rng(0).standard_normal((3, 4, 4)).astype(np.float32)
    np.testing.assert_array_equal(by_rows(field, 3, 4), field)
    np.testing.assert_array_equal(by_index(field, 48), field.ravel())


def test_a_number_is_the_same_in_every_texel() -> None:
    assert (by_rows(np.float32(0.1), 3, 4) == np.float32(0.1)).all()
    assert (by_index(np.float32(0.1), 48) == np.float32(0.1)).all()


@pytest.mark.parametrize(("function", "arguments"), [(row_of, (1.0, 0, 0)), (value_in, (1.0, 0)), (value_at, (1.0, 0))])
def test_outside_compiled_code_they_say_so(function, arguments) -> None:
    with pytest.raises(NotImplementedError, match="compiled code only"):
        function(*arguments)
