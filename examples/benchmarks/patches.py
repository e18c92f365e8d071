"""How good and how quick is the patch layout? One line a mesh.

    python examples/benchmarks/patches.py MESH ... [--resolution 128] [--arrival-sources 2]

Columns: genus and number of rims; charts and texels along their sides; seconds of processor time to build the atlas
(once compiled), and from the cache; folded texels; area of the texel mesh over that of the mesh; texel areas at 0.1 %
and 99.9 % over the median; stable time step over that of an even grid of as many texels; error of the arrival of the
front against exact geodesics, median and 90 %, in percent.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from ripple_sim.bench.arrival import arrival_error
from ripple_sim.bench.sources import spread_sources
from ripple_sim.solver import Atlas, Mesh, build_atlas, load_mesh


def timed(mesh: Mesh, resolution: int, cache: bool) -> tuple[Atlas, float]:
    start = time.process_time()
    atlas = build_atlas(mesh, resolution, layout="patches", cache=cache)
    return atlas, time.process_time() - start


def line(path: Path, resolution: int, sources: int) -> str:
    mesh = load_mesh(path)
    build_atlas(mesh, resolution, layout="patches")  # compiles, and fills the cache
    atlas, seconds = timed(mesh, resolution, cache=False)
    _, cached = timed(mesh, resolution, cache=True)
    quality, charts = atlas.quality(), atlas.areas.shape
    low, high = np.quantile(atlas.areas / np.median(atlas.areas), [0.001, 0.999])
    errors = [arrival_error(atlas, source) for source in spread_sources(atlas, sources)]
    front = "-"
    if errors:
        median, q90 = (100 * np.mean([getattr(e, name) for e in errors]) for name in ("front_median", "front_q90"))
        front = f"{median:.2f} / {q90:.2f}"
    return (
        f"| {path.stem} | {len(mesh.F):,} | {int(mesh.genus.sum())} / {len(mesh.rims)} | {charts[0]} x {charts[1]}^2 "
        f"| {seconds:.1f} / {cached:.2f} | {quality['folded']} | {quality['spanned']:.3f} | {low:.2f} / {high:.1f} "
        f"| {quality['timestep']:.2f} | {front} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--resolution", type=int, default=128)
    parser.add_argument("--arrival-sources", type=int, default=2)
    args = parser.parse_args()
    print("| mesh | triangles | genus / rims | charts | seconds / cached | folded | spanned | areas | step | arrival |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for path in args.meshes:
        print(line(path, args.resolution, args.arrival_sources), flush=True)


if __name__ == "__main__":
    main()
