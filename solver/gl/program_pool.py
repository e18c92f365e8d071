"""Programs that nobody uses at the time, for whoever asks for the same next: compiling takes as long as a frame."""

from __future__ import annotations

from typing import Any

import moderngl

_MOST = 64  # idle at a time


class ProgramPool:
    """Compiled programs and compute shaders by their sources, with the uniforms that they began with."""

    def __init__(self) -> None:
        self._idle: dict[tuple[str, ...], list[Any]] = {}
        self._begun: dict[int, tuple[tuple[str, ...], dict[str, bytes]]] = {}

    def take(self, sources: tuple[str, ...]) -> Any:
        """A program with its uniforms as after compilation, or None; within the context."""
        idle = self._idle.get(sources)
        if not idle:
            return None
        program = idle.pop()
        for name, value in self._begun[program.glo][1].items():
            program[name].write(value)
        return program

    def note(self, sources: tuple[str, ...], program: Any) -> None:
        """Remember a program that was compiled just now; within the context."""
        begun = {name: program[name].read() for name in program if isinstance(program[name], moderngl.Uniform)}
        self._begun[program.glo] = sources, begun

    def give_back(self, program: Any) -> bool:
        """Take back a program that is used no longer; False if it is to be released."""
        known = self._begun.get(program.glo)
        if known is None:
            return False
        if sum(map(len, self._idle.values())) >= _MOST:
            del self._begun[program.glo]
            return False
        self._idle.setdefault(known[0], []).append(program)
        return True
