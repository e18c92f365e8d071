"""The benchmark: accuracy as in theory, fair races, and bodies that touch."""

import functools
import itertools
import re
import time

import numpy as np
import pytest
from modes import mode_error

from ripple_sim import bench
from ripple_sim.scenes.shapes import ellipsoid, peanut, polygonise
from ripple_sim.solver import Mesh
from ripple_sim.solver.operator import OPERATORS


def test_report_reads_as_text() -> None:
    cost = {
        "touching": 3.2,
        "mj_step [s]": 2e-3,
        "coupling [s]": 3e-4,
        "waves [s]": 2e-4,
        "of mj_step": 0.15,
    }
    text = bench.as_text(
        {
            "machine": {"version": "1", "processors": 2, "renderer": "none"},
            "cpu": {"256": {"cpu": 6e8, "stream": 8e8, "of stream": 0.75}},
            "gl": {"256": None, "512": 1.2e9},
            "meshes": {
                "duck": {"triangles": 9000, "texels": 98_304, "atlas [s]": 1.5, "substep [s]": 5e-5}
            },
            "coupling": {"dish": cost},
            "sphere": {
                "fem": {"16": 0.1, "128": 1e-3, "order": 2.0},
                "paper": {"16": 0.5, "order": 0.0},
            },
            "energy": {"steps": 10_000, "largest": 1e-7, "trend": -2e-8},
        }
    )
    for row in (
        "256  600  800  0.75",
        "duck  9,000  98,304  1.50  0.050",
        "dish  3.2  2.000  0.300  0.200  0.15",
        "paper  0.5  0",  # no error of N = 128 was measured
        "over 10,000 steps: largest relative change 1.0e-07, trend -2.0e-08",
    ):
        assert row in [re.sub(r"  +", "  ", line) for line in text.splitlines()]


def test_the_modes_have_errors_for_every_operator_and_ours_is_of_second_order() -> None:
    """Only ours is measured beyond 64 texels."""
    errors = bench.sphere_modes((8, 16, 32, 65))
    assert list(errors) == list(OPERATORS)
    assert all(
        list(row) == ["8", "16", "32", *["65"] * (name == "fem"), "order"]
        for name, row in errors.items()
    )
    assert 1.7 < errors["fem"]["order"] < 2.6
    assert errors["paper"]["order"] < 0.5
    numbers = (8, 16, 32, 65)
    slope = np.polyfit(np.log(numbers), np.log([errors["fem"][str(n)] for n in numbers]), 1)[0]
    assert errors["fem"]["order"] == pytest.approx(-slope)


def test_the_error_of_a_mode_compares_it_with_itself_one_period_earlier() -> None:
    assert bench.sphere_mode_error(16) == pytest.approx(mode_error(16), rel=1e-12)
    assert 0 < bench.sphere_mode_error(16) < bench.sphere_mode_error(16, "paper")


def test_contestants_take_turns() -> None:
    calls: list[str] = []

    def advance(name: str, substeps: int, dt: float) -> None:
        calls.append(name)
        time.sleep(0.01)

    seconds = bench.race({name: functools.partial(advance, name) for name in "abc"}, rounds=4)
    assert [name for name, _ in itertools.groupby(calls)][-12:] == ["a", "b", "c"] * 4
    assert {name: len(turns) for name, turns in seconds.items()} == {"a": 4, "b": 4, "c": 4}


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_memory_stream_passes_once_over_every_texel_each_substep(threads: int) -> None:
    fields = bench.memory_fields(5000)
    streams = dict(zip(bench.FIELDS, fields[:, :5000], strict=True))
    streams["velocity"][:] = np.arange(5000)
    streams["height"][:] = 1.0
    streams["gain"][:] = 0.5
    for value, name in enumerate(("east", "north", "northeast", "northwest"), start=1):
        streams[name][:] = value
    bench.memory_stream(fields, 5000, threads)(3, 0.25)
    kicked = np.arange(5000) + 3 * 0.25 * 0.5 * (1 + 2 + 3 + 4)
    assert np.allclose(streams["velocity"], kicked)
    assert np.allclose(streams["next height"], 1 + 0.25 * kicked)


def test_a_mesh_has_the_time_of_its_atlas_and_of_its_wave_step() -> None:
    cost = bench.mesh_cost(Mesh.from_arrays(*peanut(cell=0.05)), resolution=16)
    assert cost["texels"] == 6 * 16**2
    assert min(cost["atlas [s]"], cost["substep [s]"]) > 0


def test_coupling_is_measured_on_bodies_that_touch() -> None:
    egg = polygonise(
        ellipsoid((0.0, 0.0, 0.2), (0.4, 0.3, 0.2)), ((-0.5, -0.5, -0.1), (0.5, 0.5, 0.5)), 0.1
    )
    cost = bench.coupling_cost({"egg": lambda: egg}, seconds=0.5, bodies=2, resolution=8, rounds=1)[
        "egg"
    ]
    assert cost["touching"] > 0
    assert min(cost["mj_step [s]"], cost["coupling [s]"], cost["waves [s]"]) > 0
    assert cost["of mj_step"] == pytest.approx(cost["coupling [s]"] / cost["mj_step [s]"])
