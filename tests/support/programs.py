"""Python programs in processes of their own."""

import subprocess
import sys
from typing import Any


def ended(*words: Any, **options: Any) -> subprocess.CompletedProcess[str]:
    """A Python process with these words that has ended, with what it said; options are those of `subprocess.run`."""
    return subprocess.run([sys.executable, *words], **{"capture_output": True, "text": True, "check": False, **options})
