"""Memory over the length of a video: the peak of a long render against a short one's.

    python examples/benchmarks/memory.py [SCENE] [--short 5] [--long 60] [-- OPTIONS OF ripple-sim
    render]

Each render runs in a process of its own. The figure is the most memory that the process had
(ru_maxrss).
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path


def peak(scene: str, output: Path, seconds: float, options: list[str]) -> int:
    """Render so many seconds of a scene; return the peak of resident memory [bytes]."""
    command = [
        sys.executable,
        "-m",
        "ripple_sim",
        "render",
        scene,
        "-o",
        output,
        "--duration",
        str(seconds),
        *options,
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(process.returncode)
    return usage.ru_maxrss * 1024


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Peak memory of a long render against a short one."
    )
    parser.add_argument("scene", nargs="?", default="sphere")
    parser.add_argument("--short", type=float, default=5, help="seconds")
    parser.add_argument("--long", type=float, default=60, help="seconds")
    arguments = sys.argv[1:]
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    options = parser.parse_args(arguments[:cut])
    passed = arguments[cut + 1 :]
    with tempfile.TemporaryDirectory() as folder:
        short, long = (
            peak(options.scene, Path(folder) / "clip.mp4", seconds, passed)
            for seconds in (options.short, options.long)
        )
    print(
        f"peak memory: {options.short:g} s {short / 2**20:.0f} MiB, {options.long:g} s "
        f"{long / 2**20:.0f} MiB"
    )
    print(f"ratio {long / short:.3f}")


if __name__ == "__main__":
    main()
