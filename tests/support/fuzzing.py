"""How long fuzzing goes on, what strange values are made of, and what may come of them."""

import os
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.database import DirectoryBasedExampleDatabase

from ripple_sim.solver import RippleError

# `make fuzz` sets it; what it finds is kept in a folder that git ignores, and tried first the next time. The tests take
# a few examples, always the same.
EXAMPLES = int(os.environ.get("RIPPLE_SIM_FUZZ", "0"))

fuzzed = settings(
    max_examples=EXAMPLES or 100,
    derandomize=not EXAMPLES,
    database=DirectoryBasedExampleDatabase(".hypothesis/fuzz") if EXAMPLES else None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.integers(),
    st.sampled_from([0, -1, 10**400, -(10**400), 1e-300, 1e300, float("nan"), float("inf"), True]),
)
STRANGE = ["", "\0", "a" * 5000, "../..", "/dev/null", "\ud800", "'\n\""]
TEXTS = st.one_of(st.text(max_size=20), st.sampled_from(STRANGE))
SCALARS = st.one_of(NUMBERS, TEXTS, st.none(), st.booleans())
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=3), max_leaves=6
)


def outcome(call: Callable[[], Any]) -> Any:
    """What a call returns, or its `RippleError`, whose message must be of a readable length. Other errors pass."""
    try:
        return call()
    except RippleError as error:
        assert str(error).strip()
        return error
