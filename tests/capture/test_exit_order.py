"""No crash at exit, whoever else has used OpenGL in the process."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "examples" / "benchmarks" / "exit_order.py"


def test_mujocos_renderer_ours_and_a_plotter_end_without_a_crash(opengl: None) -> None:
    order = ("mujoco", "ours", "pyvista")
    result = subprocess.run([sys.executable, SCRIPT, *order], capture_output=True, text=True, check=False, timeout=300)
    assert "| mujoco, ours, pyvista | 0 | 0 |" in result.stdout
    assert result.returncode == 0, result.stderr
