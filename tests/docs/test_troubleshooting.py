"""The page on troubleshooting quotes what the program says."""

import re
from pathlib import Path

import pytest

from ripple_sim.encode.replace import MARK

ROOT = Path(__file__).parents[2]
QUOTED = re.findall(
    r"(?<![*\w])\*([^*|]+)\*(?![*\w])", (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def messages() -> str:
    """The source, with strings that go on in the next line in one piece."""
    sources = [
        file.read_text(encoding="utf-8") for name in ("ripple_sim", "solver") for file in (ROOT / name).rglob("*.py")
    ]
    return re.sub(r'"\s*\n\s*f?"', "", "\n".join(sources)).replace("{MARK}", MARK)


@pytest.mark.parametrize("words", QUOTED)
def test_a_quoted_message_is_the_programs(words: str, messages: str) -> None:
    assert words in messages
