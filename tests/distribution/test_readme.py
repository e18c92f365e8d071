"""The README's example of a loop is as short as it says; that all its code runs, tests/docs/test_snippets.py shows."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_own_loop_is_short() -> None:
    # the ten lines that the README promises a MuJoCo user: what is not the model itself
    code = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)[0]
    own = re.sub(r'model = .*?"""\)\n', "", code, flags=re.DOTALL)
    assert len([line for line in own.splitlines() if line.strip()]) <= 10
