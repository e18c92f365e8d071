"""Runs written as Zarr stores and tables of impulses, and read by xarray, pandas and pyarrow."""

import csv
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest

from ripple_sim import Exporter, Material, Ripples

FRAMES = 20  # more than one chunk
HEADER = "frame,time [s],geom,other,x [m],y [m],z [m],impulse [N s],chart,row,column,inner"


class Hit(NamedTuple):
    """A row of a table of impulses."""

    frame: int
    other: str
    impulse: float  # [N s]
    x: float  # [m]
    y: float
    z: float

    @classmethod
    def of(cls, row: dict[str, Any], length: str = "", impulse: str = "") -> "Hit":
        """The hit of a row whose columns are named with these units."""
        point = [float(row[axis + length]) for axis in "xyz"]
        return cls(int(row["frame"]), row["other"], float(row["impulse" + impulse]), *point)


def run(ripples: Ripples, path: Path, **options: Any) -> list[dict[str, Any]]:
    """Export a run, and return what was at each frame."""
    data = mujoco.MjData(ripples.model)
    seen = []
    ripples.reset()
    with Exporter(ripples.model, ripples, path, **options) as exporter:
        for _ in range(FRAMES):
            ripples.mj_step(data, nstep=2)
            exporter.write(data)
            waves = ripples["egg"]
            fields = {"height": waves.height, "velocity": waves.velocity, "energy": waves.energy()}
            bodies = {
                "time": data.time,
                "position": data.xpos.copy(),
                "impulses": list(ripples.last_impulses),
            }
            seen.append(fields | bodies)
    return seen


def test_xarray_opens_a_run_in_one_line_with_units_and_coordinates(
    ripples: Ripples, tmp_path: Path
) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    path = tmp_path / "run.zarr"
    seen = run(ripples, path)
    fields = xarray.open_zarr(path)
    assert fields.height_egg.dims == ("time", "chart_egg", "row_egg", "column_egg")
    assert np.array_equal(fields.time, [each["time"] for each in seen])
    for name in ("height", "velocity", "energy"):
        assert np.array_equal(fields[f"{name}_egg"], [each[name] for each in seen])
    assert np.abs(fields.height_egg).max() > 0
    assert np.array_equal(fields.position, [each["position"] for each in seen])
    assert fields.position.sel(body="stone", axis="z")[-1] == seen[-1]["position"][2, 2]
    assert fields.velocity_egg.attrs["units"] == "m/s"
    assert np.array_equal(fields.x_egg, ripples["egg"].atlas.positions[..., 0])
    impulses = [hit.impulse for each in seen for hit in each["impulses"]]
    assert np.array_equal(fields.impulse_impulse, impulses)
    assert fields.sizes["impulse"] > 0


def test_texels_of_a_surface_that_moves_have_their_places_over_time(
    ripples: Ripples, tmp_path: Path
) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    model = ripples.model
    ripples = Ripples(model, {"egg": Material(speed=0.3)}, resolution=4, backend="cpu")
    data = mujoco.MjData(model)
    waves = ripples["egg"]
    seen = []
    with Exporter(model, ripples, tmp_path / "run.zarr") as exporter:
        for frame in range(FRAMES):
            if frame >= 5:
                waves.move(waves.rest.mesh.V * [1.0, 1.0, 1.0 + 0.01 * frame])
            ripples.mj_step(data)
            exporter.write(data)
            seen.append(waves.atlas.positions)
    fields = xarray.open_zarr(tmp_path / "run.zarr")
    assert fields.z_egg.dims == ("time", "chart_egg", "row_egg", "column_egg")
    assert fields.z_egg.attrs["units"] == "m"
    found = np.stack([fields[f"{axis}_egg"] for axis in "xyz"], axis=-1)
    assert np.abs(found - seen).max() < 1e-12
    assert np.array_equal(found[4], waves.rest.positions)
    assert np.ptp(found[:, ..., 2], axis=0).max() > 0.01


@pytest.mark.parametrize("name", ["run.csv", "run.parquet"])
def test_a_table_has_a_row_for_each_impulse(ripples: Ripples, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    seen = run(ripples, path)
    expected = []
    for frame, each in enumerate(seen):
        expected += [Hit(frame, hit.other, hit.impulse, *hit.point) for hit in each["impulses"]]
    assert expected
    if path.suffix == ".csv":
        with path.open() as file:
            rows = csv.DictReader(file)
            hits = [Hit.of(row, length=" [m]", impulse=" [N s]") for row in rows]
        assert ",".join(rows.fieldnames) == HEADER
    else:
        table = pytest.importorskip("pyarrow.parquet").read_table(path)
        assert table.schema.field("impulse").metadata[b"unit"] == b"N s"
        hits = [Hit.of(row) for row in table.to_pylist()]
    assert hits == expected
