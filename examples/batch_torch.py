"""A batch as PyTorch's data: frames and heights in, the impulse at each frame out.

    pip install torch webdataset
    python examples/batch_torch.py DIR [--workers 2]

DIR is the folder of a batch with a video, `heights = true` and `impulses = true`. Scenes are read
by the loader's own processes: from folders and tar files with `load_batch`, and, where the batch
has tar files, with webdataset too, which reads them one after another as they lie on the disk or
behind an address.
"""

import argparse
import io
import json
import sys
from pathlib import Path

import numpy as np

from ripple_sim import load_batch


class Scenes:
    """Arrays of one scene after another, and the impulse of each frame [N s].

    The arrays are frames [frames, height, width, 3] and heights [frames, C, n, n]. A `DataLoader`
    accepts any object with these three methods, and converts the arrays to tensors.
    """

    def __init__(self, folder: Path) -> None:
        self.batch = load_batch(folder)

    def __len__(self) -> int:
        return len(self.batch)

    def __getitem__(self, number: int) -> dict[str, np.ndarray]:
        scene = self.batch[number]
        frames = np.stack(list(scene.frames()))
        impulses = scene.impulses()
        each = np.bincount(impulses["frame"], impulses["impulse"], minlength=len(frames))
        heights = next(iter(scene.heights().values()))
        return {"frames": frames, "heights": heights, "impulse": each}


def label(sample: dict[str, bytes]) -> tuple[int, float, int]:
    """Number, impulse and length of each position in a sample of webdataset.

    The keys of a sample are the ends of file names.
    """
    facts = json.loads(sample["scene.json"])
    return facts["number"], facts["impulse"], len(np.load(io.BytesIO(sample["qpos.npy"])))


def main() -> None:
    parser = argparse.ArgumentParser(description="Reads a batch with PyTorch.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    try:
        import webdataset
        from torch.utils.data import DataLoader
    except ImportError as error:
        sys.exit(f"{error}; this example needs: pip install torch webdataset")
    loader = DataLoader(
        Scenes(options.folder), batch_size=4, shuffle=True, num_workers=options.workers
    )
    for batch in loader:
        print({name: tuple(values.shape) for name, values in batch.items()})
    tars = sorted(str(path) for path in (options.folder / "tars").glob("*.tar"))
    if tars:
        for number, impulse, frames in webdataset.WebDataset(tars, shardshuffle=False).map(label):
            print(f"scene {number}: {frames} frames, {impulse:.3g} N s")


if __name__ == "__main__":
    main()
