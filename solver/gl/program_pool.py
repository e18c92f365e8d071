"""Programs that nobody uses at the time, for whoever asks for the same next: compiling takes as long as a frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl

_MOST = 64  # idle at a time


class ProgramPool:
    """Compiled programs and compute shaders by their sources, with the uniforms that they began with."""

    def __init__(self) -> None:
        self._idle: dict[int, Any] = {}  # by their number in OpenGL, the longest idle first
        self._begun: dict[int, tuple[tuple[str, ...], dict[str, bytes]]] = {}

    def take(self, sources: tuple[str, ...], compiled: Callable[[], Any]) -> Any:
        """An idle program with its uniforms as after compilation, or else a new one; within the context."""
        for number in reversed(self._idle):
            known, begun = self._begun[number]
            if known == sources:
                program = self._idle.pop(number)
                for name, value in begun.items():
                    program[name].write(value)
                return program
        program = compiled()
        begun = {name: program[name].read() for name in program if isinstance(program[name], moderngl.Uniform)}
        self._begun[program.glo] = sources, begun
        return program

    def give_back(self, program: Any) -> Any:
        """Take back a program that is used no longer; return the one to be released for it, or None.

        That is the longest idle one where there are too many, and the program itself where it is unknown.
        """
        if program.glo not in self._begun:
            return program
        self._idle[program.glo] = program
        if len(self._idle) <= _MOST:
            return None
        oldest = next(iter(self._idle))
        del self._begun[oldest]
        return self._idle.pop(oldest)
