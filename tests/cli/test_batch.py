import pytest
from small_batch import PLAN, new_batch, write_files

from ripple_sim.cli.main import main


@pytest.fixture
def plan(tmp_path):
    """The path of a plan whose scenes are not drawn."""
    write_files(tmp_path)
    path = tmp_path / "plan.toml"
    path.write_text(PLAN + 'video = "none"\n')
    return path


def test_a_dry_run_prints_values_time_and_disk_space_and_writes_nothing(plan, capsys):
    assert main(["batch", str(plan), "--dry-run", "--workers", "4"]) == 0
    out = capsys.readouterr().out
    assert [line.split(" (scene.toml, seed ")[0] for line in out.splitlines()[:3]] == [
        "scene 0",
        "scene 1",
        "scene 2",
    ]
    assert all(
        each in out for each in ("camera.azimuth = ", "5 scenes of 4 frames: ", "here by 4 workers")
    )
    assert sorted(path.name for path in plan.parent.iterdir()) == [
        "plan.toml",
        "scene.toml",
        "scene.xml",
    ]


def test_the_status_comes_from_the_folder(tmp_path, capsys):
    batch = new_batch(tmp_path)
    assert main(["batch", str(batch.path), "--status"]) == 0
    assert "0 of 5 scenes finished, 0 put aside, 5 to be made" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["{plan}"], "add -o DIR"),
        (
            ["{plan}", "-o", "{folder}/out", "--shard", "5/4"],
            "it must be a part of how many",
        ),
        (["{folder}"], "it has no plan.json"),
        (["{folder}/lost.toml", "-o", "out"], "does not exist"),
    ],
    ids=["no folder", "shard", "no batch", "no plan"],
)
def test_errors_are_one_line(plan, refusal, options, message):
    assert message in refusal(
        "batch", *(each.format(plan=plan, folder=plan.parent) for each in options)
    )
