"""Plans and export options of any content work or are refused in one line."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fuzzing
import pytest
from fuzzing import fuzzed, fuzzed_by, home_of_others, outcome
from hypothesis import assume, given, strategies as st
from small_batch import PLAN, Here, write_files
from unfinished_videos import contents

from ripple_sim.batch import Plan, RunOptions, Variation, plan as plans, read_plan, run, run_batch
from ripple_sim.errors import RippleError

TABLE = tomllib.loads(PLAN + 'video = "none"\n')
KEYS = [
    "camera.azimuth",
    "camera.lookat[1]",
    "ripple[egg].material.speed",
    "ripple[egg].look",
    "ripple.geom",
]
ATTRIBUTES = [
    "geom[stone].mass",
    "geom[*].size",
    "geom.pos[2]",
    "body[grain].quat",
    "option.timestep",
    "light.name",
]
KINDS = [
    "uniform",
    "log_uniform",
    "normal",
    "integers",
    "choice",
    "orientation",
    "constant",
    "weights",
    "length",
]
OPTIONS = ["apply", "together", "limits"]
LIKELY = (
    st.lists(st.floats(0.1, 2) | fuzzing.NUMBERS, min_size=2, max_size=3)
    | st.integers(0, 3)
    | fuzzing.VALUES
)
DRAWN = (
    st.dictionaries(st.sampled_from([*KINDS, *OPTIONS]), LIKELY, min_size=1, max_size=2) | LIKELY
)


@pytest.fixture(autouse=True, scope="module")
def _in_this_process() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "LocalExecutor", Here)
        yield


def tried(home: Path) -> None:
    """Read a plan, and draw the values of two scenes; make one if it is small."""

    def work() -> Plan:
        plan = read_plan(home / "plan.toml")
        scenes = [Variation(plan, number).load()[0] for number in range(2)]
        options = plans.options_of(plan.store)
        seconds = (
            max(scene.duration for scene in scenes)
            if options.duration is None
            else options.duration
        )
        steps = seconds / min(scene.model.opt.timestep for scene in scenes)
        if (
            steps < 50
            and plan.store.fps * seconds < 9
            and max(options.size) <= 64
            and plan.store.video == "none"
        ):
            run_batch(plan, home / "out", RunOptions(limit=1, keep_free=0))
        return plan

    assert isinstance(outcome(work), Plan | RippleError)


@fuzzed
@given(st.sampled_from(fuzzing.places(TABLE)[1:]), fuzzing.VALUES | DRAWN)
def test_a_plan_with_any_value_anywhere(place: tuple, value: Any) -> None:
    assume("\\ud800" not in repr(value))  # which no TOML file can hold
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        write_files(home)
        patch.setattr(plans, "read_toml", lambda *_: fuzzing.put(TABLE, place, value))
        tried(home)


@fuzzed
@given(
    st.sampled_from(["vary", "model"]),
    st.sampled_from([*KEYS, "duration", *ATTRIBUTES]) | fuzzing.TEXTS,
    DRAWN,
)
def test_a_plan_with_any_random_distribution(part: str, key: str, drawn: Any) -> None:
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        write_files(home)
        patch.setattr(plans, "read_toml", lambda *_: TABLE | {part: {key: drawn}})
        tried(home)


@fuzzed
@given(fuzzing.CHANGES)
def test_a_plan_with_any_bytes_anywhere(changes: list) -> None:
    with home_of_others() as home:
        write_files(home)
        (home / "plan.toml").write_bytes(fuzzing.changed(PLAN.encode(), changes))
        tried(home)


CHOICES = {
    "-o": ["run.usda", "run.usdc", "run.usdz", "run.html", "run.zarr", "run.csv", "run.parquet",
           "a/b.csv", ".csv", "x", "run.csv/y.csv", "thesis", "thesis/chapter.tex", "thesis.csv"],
    "--fps": [20, 100, 0, 1001, "x"],
    "--chunk": [1, 2, 3, 100, 0, -1, "x"],
    "--duration": [0.05, 0.1, 0.001, 0, -1, "nan", "inf", 1e300],
    "--slow-motion": [1, 0.5, 2, 0, "nan", 1e-300],
    "--size": ["64x48", "16x16", "15x15", "9999x1", "x"],
    "--triangles": [1, 10, 1000, 10**9, 0],
    "--tessellation": ["refined", "own", "x"],
    "--resolution": [4, 9, 3, 0, 10**9, "x"],
    "--layout": ["cube", "patches", "auto", "x"],
    "--rim": ["free", "fixed", ""],
    "--backend": ["cpu", "gl", "x"],
    "--camera": ["", "nobody"],
    "--seed": [0, -1, 10**20],
}  # fmt: skip
WORDS = st.sampled_from([(name, value) for name, values in CHOICES.items() for value in values])
FLAGS = st.sampled_from([("--overwrite",), ("--resume",)])


@fuzzed_by(30)
@given(st.sampled_from(CHOICES["-o"]), st.lists(WORDS | FLAGS, max_size=4), st.booleans())
def test_an_export_with_any_options_twice(output: str, words: list[tuple], foreign: bool) -> None:
    with home_of_others() as home, pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        write_files(home)
        (home / "thesis.csv").symlink_to("thesis/chapter.tex")
        if foreign:
            (home / "run.csv").write_text("mine")
        for _ in range(2):
            before = contents(home)
            given = [word for each in words if each != ("--overwrite",) for word in each]
            if fuzzing.command(
                "export", "scene.toml", "-o", output, "--fps", 20, "--duration", 0.1, *given
            ):
                assert contents(home) == before
            assert not [each for each in home.rglob("*") if each.name.endswith(".part")]
