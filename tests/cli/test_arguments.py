"""Words of the command line: what they mean, and what is said where they mean nothing."""

import math
from collections.abc import Callable

import pytest

from ripple_sim.cli import arguments


@pytest.mark.parametrize(
    ("parse", "word", "value"),
    [
        ("size", "1280x720", (1280, 720)),
        ("size", "16x999999999", (16, 999999999)),
        ("count", "1", 1),
        ("count", "007", 7),
        ("seed", "0", 0),
        ("seconds", "2.5e-1", 0.25),
        ("factor", "4", 4.0),
        ("angle", "0", 0.0),
        ("angle", "360", 360.0),
        ("diameter", "0", 0.0),
        ("focus", "1.5", 1.5),
        ("focus", "stone", "stone"),
        ("focus", "2nd", "2nd"),
        ("supersample", "4", 4),
        ("axis", "z", "z"),
        ("overlay", "height=0.02, contacts ,time", ("height=0.02", "contacts", "time")),
        ("overlay", "", ()),
        ("overlay", "  ", ()),
    ],
)
def test_a_word_is_read(parse: str, word: str, value: object) -> None:
    read = getattr(arguments, f"parse_{parse}")(word)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("parse", "words", "valid"),
    [
        ("size", ["", "1280", "1280X720", "1280 x 720", "-1x5", "1.5x2", "1x2x3", "٣x٣", "1280x720\n"], "WIDTHxHEIGHT"),
        ("count", ["0", "-1", "1.0", "", "ten", "1e3", "1000000000", "²"], "a whole number, 1 or more"),
        ("seed", ["-1", "0.5", ""], "a whole number, 0 or more"),
        ("seconds", ["0", "-0.0", "-1", "nan", "inf", "1s", ""], "a positive number of seconds"),
        ("factor", ["0", "inf", "nan", "4x"], "a positive number, such as 4"),
        ("angle", ["-1", "360.001", "nan", "inf", "half"], "an angle from 0 to 360 degrees"),
        ("diameter", ["-0.01", "inf", "nan", "2mm"], "a number of metres, 0 or more"),
        ("supersample", ["0", "5", "1.0", "11", ""], "1, 2, 3 or 4"),
        ("axis", ["x", "Z", ""], "y or z"),
    ],
)
def test_what_is_not_valid_is_quoted_with_what_would_be(parse: str, words: list[str], valid: str) -> None:
    for word in words:
        with pytest.raises(ValueError, match="valid") as refusal:
            getattr(arguments, f"parse_{parse}")(word)
        assert repr(word) in str(refusal.value)
        assert valid in str(refusal.value)


@pytest.mark.parametrize(
    "parse", [arguments.parse_seconds, arguments.parse_factor, arguments.parse_angle, arguments.parse_diameter]
)
def test_numbers_that_are_read_are_finite(parse: Callable[[str], float]) -> None:
    for word in ("1e-300", "1", "359.5"):
        assert math.isfinite(parse(word))
    with pytest.raises(ValueError, match="valid"):
        parse("1e999")
