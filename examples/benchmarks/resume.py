"""A render that is killed again and again gives the same result as an unbroken render.

    python examples/benchmarks/resume.py [SCENE] [--kills 20] [--step 1] [--output clip.mp4] [--
    OPTIONS OF render]

`ripple-sim render SCENE -o FILE --resume` is started and killed (SIGKILL) at random moments as
often as asked: within seconds of its start, or of the next clip or picture that it has stored (the
`--step`th at the latest). Then it is left to finish, and compared byte for byte with the video of a
run that was left alone.
"""

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def start(scene: str, output: Path, options: list[str]) -> subprocess.Popen:
    command = [
        sys.executable,
        "-m",
        "ripple_sim",
        "render",
        scene,
        "-o",
        output,
        "--resume",
        *options,
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def stored(path: Path) -> list[str]:
    """Names of the clips or pictures that are whole."""
    return sorted(file.name for file in path.with_name(f"{path.name}.part").glob("frames/[!.]*"))


def contents(path: Path) -> dict[str, bytes]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


def main() -> None:
    parser = argparse.ArgumentParser(description="Kills a render, resumes it, and compares.")
    parser.add_argument("scene", nargs="?", default="sphere")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument(
        "--step", type=int, default=1, help="stored clips or pictures between kills, at most"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--output", default="clip.mp4", help="name of the video; its ending chooses the format"
    )
    arguments = sys.argv[1:]
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    options = parser.parse_args(arguments[:cut])
    passed = arguments[cut + 1 :]
    chance = random.Random(options.seed)

    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole" / options.output
        broken = Path(folder) / "broken" / options.output
        process = start(options.scene, whole, passed)
        said = process.communicate()[0]
        if process.returncode:
            sys.exit(said)
        for kill in range(options.kills):
            if broken.exists():
                sys.exit(f"it was done after {kill} kills: ask for a longer --duration")
            process = start(options.scene, broken, passed)
            wanted = len(stored(broken)) + chance.randint(0, options.step)
            while len(stored(broken)) < wanted and process.poll() is None:
                time.sleep(0.01)
            time.sleep(chance.uniform(0, 3))
            process.send_signal(signal.SIGKILL)
            process.communicate()
            print(f"kill {kill + 1}: kept {stored(broken)[-1:]}", flush=True)
        process = start(options.scene, broken, passed)
        print(process.communicate()[0].splitlines()[0])
        left = sorted(path.name for path in broken.parent.iterdir())
        same = (
            process.returncode == 0
            and contents(whole) == contents(broken)
            and left == [broken.name]
        )
    print("identical" if same else "DIFFERENT")
    sys.exit(not same)


if __name__ == "__main__":
    main()
