"""Arrays in a file: what comes back is what was written, or the damage is named."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver.texels.atlas import read_arrays, write_arrays


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    return {
        "positions": rng.standard_normal((2, 3, 4)),
        "triangles": rng.integers(0, 100, (5, 3)).astype(np.int32),
        "kind": np.array(["Atlas"]),
        "nothing": np.empty((0, 3)),
        "scalar": np.array(7),
        "transposed": rng.standard_normal((3, 2)).T,
    }


def written(path: Path, arrays: dict[str, np.ndarray]) -> bytes:
    with path.open("wb") as file:
        write_arrays(file, {name: np.ascontiguousarray(array) for name, array in arrays.items()})
    return path.read_bytes()


def same(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> bool:
    return found.keys() == expected.keys() and all(
        found[name].dtype == expected[name].dtype and np.array_equal(found[name], expected[name]) for name in expected
    )


def test_arrays_come_back_and_numpy_reads_them_too(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    written(tmp_path / "arrays.npz", arrays)
    expected = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    found = read_arrays(tmp_path / "arrays.npz")
    assert same(found, expected)
    assert all(array.flags.writeable for array in found.values())
    with np.load(tmp_path / "arrays.npz") as file:
        assert same({name: file[name] for name in file.files}, expected)


def test_no_flipped_bit_changes_an_array(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    path = tmp_path / "arrays.npz"
    whole = written(path, {name: arrays[name] for name in ("positions", "kind")})
    expected = read_arrays(path)
    bits = np.random.default_rng(1).integers(0, 8, len(whole))
    refused = 0
    for place, bit in enumerate(bits):
        changed = bytearray(whole)
        changed[place] ^= 1 << bit
        path.write_bytes(changed)
        try:
            found = read_arrays(path)
        except ValueError:
            refused += 1
        else:  # a date or an unused flag of the archive, or a name: the content is sound
            assert all(any(np.array_equal(array, other) for other in expected.values()) for array in found.values())
    assert refused > 0.6 * len(whole)


def test_no_part_of_a_file_is_taken_for_the_whole(tmp_path: Path, arrays: dict[str, np.ndarray]) -> None:
    path = tmp_path / "arrays.npz"
    whole = written(path, arrays)
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"."):
            read_arrays(path)


@pytest.mark.parametrize("foreign", [b"", b"solid nonsense", b"PK\x03\x04" + bytes(60)])
def test_other_files_are_refused(tmp_path: Path, foreign: bytes) -> None:
    path = tmp_path / "arrays.npz"
    path.write_bytes(foreign)
    with pytest.raises(ValueError, match=r"."):
        read_arrays(path)


def test_compressed_and_pickled_arrays_are_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "compressed.npz", a=np.zeros(1000))
    np.savez(tmp_path / "pickled.npz", a=np.array([{}], dtype=object))
    for name in ("compressed.npz", "pickled.npz"):
        with pytest.raises(ValueError, match=r"'a\.npy' is damaged"):
            read_arrays(tmp_path / name)
