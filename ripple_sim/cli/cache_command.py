"""`ripple-sim cache`."""

from __future__ import annotations

import dataclasses


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cache:
    """Show where atlases are kept, and how much room they take: at most RIPPLE_SIM_CACHE_LIMIT megabytes, or 500."""

    clear: bool = False
    """Remove them."""

    def run(self) -> None:
        """Clear the cache if asked to, and print what is in it."""
        from ripple_sim.solver.cache import cache_folder, cache_limit, cached_files, remove

        limit, files = cache_limit(), cached_files()
        if self.clear:
            freed = sum(remove(file) for file in files)
            print(f"removed {len(files)} files, {_megabytes(freed)} MB")
            files = cached_files()
        size = sum(file.size for file in files)
        print(f"{cache_folder()}: {len(files)} files, {_megabytes(size)} of {_megabytes(limit)} MB")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.0f}"
