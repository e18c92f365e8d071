"""Fences wait for what the driver says, call by call. The driver here is made of Python functions."""

import ctypes

import pytest

from ripple_sim.solver import GLError
from ripple_sim.solver.gl.context import Fences

ALREADY, EXPIRED, SATISFIED, FAILED = 0x911A, 0x911B, 0x911C, 0x911D


class Driver:
    """Answers waits with the given states in turn, and notes what it is asked for."""

    def __init__(self, *states: int) -> None:
        self.states, self.calls = list(states), []
        pointer, number, wide = ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64
        self._functions = {
            b"glFenceSync": ctypes.CFUNCTYPE(pointer, number, number)(self._create),
            b"glClientWaitSync": ctypes.CFUNCTYPE(number, pointer, number, wide)(self._wait),
            b"glDeleteSync": ctypes.CFUNCTYPE(None, pointer)(self._delete),
        }

    def address(self, name: bytes) -> int:
        return ctypes.cast(self._functions[name], ctypes.c_void_p).value

    def _create(self, condition: int, flags: int) -> int:
        self.calls.append(("create", condition, flags))
        return 2**40 + 5

    def _wait(self, fence: int, flags: int, patience: int) -> int:
        assert patience > 0
        self.calls.append(("wait", fence, flags))
        return self.states.pop(0)

    def _delete(self, fence: int) -> None:
        self.calls.append(("delete", fence))


FENCE = 2**40 + 5  # handles are pointers, wider than 32 bits
WAIT, DELETE = ("wait", FENCE, 1), ("delete", FENCE)


@pytest.mark.parametrize("state", [ALREADY, SATISFIED])
def test_a_fence_that_is_reached_is_deleted(state: int) -> None:
    driver = Driver(state)
    fences = Fences(driver.address)
    assert fences.reached(fences.put(), 0.1)
    assert driver.calls == [("create", 0x9117, 0), WAIT, DELETE]


def test_a_fence_that_is_not_reached_in_time_stays() -> None:
    driver = Driver(EXPIRED, SATISFIED)
    fences = Fences(driver.address)
    assert not fences.reached(FENCE, 0.1)
    assert driver.calls == [WAIT]
    assert fences.reached(FENCE, 0.1)


def test_a_failed_wait_deletes_the_fence_and_raises() -> None:
    driver = Driver(FAILED)
    with pytest.raises(GLError, match="cannot wait for its own commands; see `ripple-sim info`"):
        Fences(driver.address).reached(FENCE, 0.1)
    assert driver.calls == [WAIT, DELETE]
