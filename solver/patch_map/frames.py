"""Changes from one frame to another on charts: a turn by right angles, counter-clockwise, then a whole shift."""

from __future__ import annotations

from typing import TypeAlias

from ripple_sim.solver.kernel import kernel

# turn, and shift along columns and rows
Frame: TypeAlias = tuple[int, int, int]


@kernel(inline="always")
def turned(x: float, y: float, turn: int) -> tuple[float, float]:
    """A vector after a turn."""
    if turn == 0:
        return x, y
    if turn == 1:
        return -y, x
    if turn == 2:
        return -x, -y
    return y, -x


@kernel(inline="always")
def turned_whole(x: int, y: int, turn: int) -> tuple[int, int]:
    """A whole vector after a turn."""
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
    x, y = turned_whole(first[1], first[2], second[0])
    return (first[0] + second[0]) % 4, x + second[1], y + second[2]


@kernel(inline="always")
def inverse(frame: Frame) -> Frame:
    """The change back."""
    back = (4 - frame[0]) % 4
    x, y = turned_whole(-frame[1], -frame[2], back)
    return back, x, y
