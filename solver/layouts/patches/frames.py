"""Changes from one frame to another on charts: a turn by right angles, counter-clockwise, then a whole shift."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

from ...kernel import kernel

# turn, and shift along columns and rows
Frame: TypeAlias = tuple[int, int, int]
# turned vectors stay whole where they are
Number = TypeVar("Number", int, float)


@kernel(inline="always")
def turned(x: Number, y: Number, turn: int) -> tuple[Number, Number]:
    """A vector after a turn."""
    if turn == 0:
        return x, y
    if turn == 1:
        return -y, x
    if turn == 2:
        return -x, -y
    return y, -x


@kernel(inline="always")
def after(first: Frame, second: Frame) -> Frame:
    """Two changes, one after the other."""
    x, y = turned(first[1], first[2], second[0])
    return (first[0] + second[0]) % 4, x + second[1], y + second[2]


@kernel(inline="always")
def inverse(frame: Frame) -> Frame:
    """The change back."""
    back = (4 - frame[0]) % 4
    x, y = turned(-frame[1], -frame[2], back)
    return back, x, y
