"""Files that others made stay, without `--overwrite`; links are written through."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ripple_sim.encode import FrameWriter, check_output, made_here, open_writer
from ripple_sim.errors import EncodingError, ExportError, VideoError
from ripple_sim.export import check_export
from ripple_sim.figures import check_plot_path
from ripple_sim.solver import AtlasError, RippleError, load_atlas, sphere_atlas
from ripple_sim.solver.texels import check_atlas_place

SIZE = {"width": 32, "height": 16, "fps": 25}
FRAME = np.full((16, 32, 3), 90, np.uint8)
ENDINGS = [".mp4", ".webm", ".gif", ".webp", ""]


def write(path: Path, overwrite: bool = False, count: int = 2, **settings: str) -> FrameWriter:
    with open_writer(path, **SIZE, overwrite=overwrite, settings=settings or None) as writer:
        for _ in range(count):
            writer.write(FRAME)
    return writer


def tree(folder: Path) -> dict[str, bytes]:
    return {
        str(each.relative_to(folder)): each.read_bytes()
        for each in folder.rglob("*")
        if each.is_file()
    }


@pytest.mark.parametrize("ending", ENDINGS)
def test_our_own_output_is_replaced_by_the_next_job(tmp_path: Path, ending: str) -> None:
    made = tmp_path / f"clip{ending}"
    write(made, count=3)
    write(made, count=2)
    assert all(map(made_here, made.iterdir())) if made.is_dir() else made_here(made)
    assert [each.name for each in tmp_path.iterdir()] == [made.name]


def test_exr_frames_are_recognised_as_our_own(tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    for _ in range(2):
        with open_writer(tmp_path / "frames", **SIZE, frame_format="exr") as writer:
            writer.write(FRAME.astype(np.float16))
    assert made_here(tmp_path / "frames" / "frame_00000.exr")


@pytest.mark.parametrize("ending", ENDINGS[:-1])
def test_a_foreign_file_is_replaced_only_with_overwrite(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"holiday{ending}"
    path.write_bytes(b"precious")
    said = "exists and was not made by ripple-sim; name another file, or add --overwrite"
    with pytest.raises(VideoError, match=said):
        check_output(path, 32, 16, 25)
    with pytest.raises(VideoError, match="--overwrite"):
        write(path)
    assert tree(tmp_path) == {path.name: b"precious"}
    write(path, overwrite=True)
    assert made_here(path)


def test_foreign_frames_are_replaced_only_with_overwrite(tmp_path: Path) -> None:
    path = tmp_path / "frames"
    path.mkdir()
    Image.fromarray(FRAME).save(path / "frame_00000.png")
    before = tree(tmp_path)
    with pytest.raises(
        VideoError, match=r"frames that were not made by ripple-sim \(frame_00000\.png\)"
    ):
        write(path)
    assert tree(tmp_path) == before
    write(path, overwrite=True)
    assert made_here(path / "frame_00000.png")


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", ["folder", "link"])
def test_a_folder_with_a_frames_name_is_never_deleted(
    tmp_path: Path, kind: str, overwrite: bool
) -> None:
    stranger = tmp_path / "thesis"
    path = tmp_path / "frames"
    (path if kind == "link" else path / "frame_00000.png").mkdir(parents=True)
    stranger.mkdir()
    if kind == "link":
        (path / "frame_00000.png").symlink_to(stranger)
    (path / "frame_00000.png" / "chapter.tex").write_text("mine")
    before = tree(tmp_path)
    with pytest.raises(VideoError, match=r"holds other files \(frame_00000\.png\)"):
        write(path, overwrite=overwrite)
    assert tree(tmp_path) == before


def test_a_file_that_appears_while_frames_are_written_stays(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with pytest.raises(EncodingError, match="--overwrite"), open_writer(path, **SIZE) as writer:
        writer.write(FRAME)
        path.write_bytes(b"mine")
    assert path.read_bytes() == b"mine"


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    link = tmp_path / "clip.gif"
    link.symlink_to("disk/real.gif")
    for _ in range(2):
        write(link)
        assert link.is_symlink()
        assert tree(tmp_path / "disk").keys() == {"real.gif"}
    (tmp_path / "disk" / "real.gif").write_bytes(b"mine")
    with pytest.raises(VideoError, match="--overwrite"):
        write(link)


@pytest.mark.parametrize("name", ["run.usda", "run.usdc", "run.csv"])
def test_an_export_through_a_link_to_another_ending_is_refused(tmp_path: Path, name: str) -> None:
    link = tmp_path / name
    # USD would write it to a name of the ending's beside, and that was lost
    for target in ("nowhere", "run.mp4"):
        link.symlink_to(target)
        with pytest.raises(
            ExportError, match=f"is a link to '{target}': it must be a link to a name that ends in"
        ):
            check_export(link, True)
        link.unlink()
    link.symlink_to(f"real{link.suffix}")
    check_export(link, True)


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_part_folder_that_is_a_link_is_left_alone(tmp_path: Path, overwrite: bool) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "states.txt").write_text("mine")
    (tmp_path / "clip.mp4.part").symlink_to(tmp_path / "thesis")
    with pytest.raises(VideoError, match=r"clip\.mp4\.part is a link"):
        write(tmp_path / "clip.mp4", overwrite=overwrite)
    assert tree(tmp_path / "thesis") == {"states.txt": b"mine"}


@pytest.mark.parametrize(
    "name", ["frames/photo.jpg", "frames/frame_00000.png", "frames/deep/a.txt", "settings.json"]
)
def test_strangers_in_a_part_folder_are_left_alone(tmp_path: Path, name: str) -> None:
    stranger = tmp_path / "clip.part" / name
    stranger.parent.mkdir(parents=True)
    stranger.write_text("[1]")
    with pytest.raises(VideoError, match="holds other files"):
        write(tmp_path / "clip", overwrite=True)
    assert stranger.read_text() == "[1]"


def test_an_atlas_never_takes_its_meshs_place(
    tmp_path: Path, refusal: Callable[..., str], tetrahedron: Path
) -> None:
    before = tetrahedron.read_bytes()
    link = tmp_path / "link.npz"
    link.symlink_to(tetrahedron)
    command = "atlas", str(tetrahedron)
    for output in (tetrahedron, link):
        for more in ([], ["--overwrite"]):
            assert "it is the mesh itself" in refusal(*command, "-o", str(output), *more)
    (tmp_path / "notes.npz").write_text("mine")
    (tmp_path / "photo.png").write_text("mine")
    assert "is no atlas" in refusal(*command, "-o", str(tmp_path / "notes.npz"))
    assert "--overwrite" in refusal(*command, "--plot", str(tmp_path / "photo.png"))
    assert tetrahedron.read_bytes() == before
    assert {each.read_text() for each in (tmp_path / "notes.npz", tmp_path / "photo.png")} == {
        "mine"
    }


def test_an_atlas_replaces_an_older_one_and_goes_through_links(tmp_path: Path) -> None:
    link = tmp_path / "link.npz"
    link.symlink_to("real.npz")
    for resolution in (4, 5):
        sphere_atlas(resolution=resolution).save(link)
        assert link.is_symlink()
        assert load_atlas(tmp_path / "real.npz").resolution == resolution
    np.savez(tmp_path / "mine.npz", mine=FRAME)
    with pytest.raises(AtlasError, match="is no atlas"):
        check_atlas_place(tmp_path / "mine.npz", overwrite=False)
    sphere_atlas(resolution=4).save(tmp_path / "mine.npz", overwrite=True)
    assert load_atlas(tmp_path / "mine.npz").resolution == 4


@pytest.mark.parametrize("kind", ["circle", "long"])
@pytest.mark.parametrize(
    ("ending", "check"),
    [
        (".mp4", lambda path: check_output(path, 32, 16, 25)),
        ("", lambda path: check_output(path, 32, 16, 25)),
        (".csv", lambda path: check_export(path, False)),
        (".usda", lambda path: check_export(path, False)),
        (".npz", lambda path: check_atlas_place(path, False)),
        (".png", lambda path: check_plot_path(path, False)),
    ],
)
def test_impossible_file_names_are_refused_before_work_begins(
    tmp_path: Path, ending: str, check, kind: str
):
    path = tmp_path / (
        f"circle{ending}" if kind == "circle" else (250 - len(ending)) * "a" + ending
    )
    if kind == "circle":
        path.symlink_to(path.name)
    with pytest.raises(
        RippleError, match=r"File name too long|Too many levels of symbolic links"
    ) as refusal:
        check(path)
    assert isinstance(refusal.value, VideoError | ExportError | AtlasError)


def test_a_file_where_the_part_folder_would_be_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "clip.mp4.part").write_bytes(b"precious")
    with pytest.raises(VideoError, match=r"clip\.mp4\.part beside it is no folder; move it away"):
        write(tmp_path / "clip.mp4", overwrite=True)
    assert tree(tmp_path) == {"clip.mp4.part": b"precious"}
