"""`PageWriter`: a run as one self-contained page, which lives in any browser and in notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import made_here

from .page_coding import packed
from .page_content import PageContent, json_script
from .source import Source, Writer

__all__ = ["PageWriter", "made_here"]

_CHUNK = 16  # frames that are decoded together


class PageWriter(Writer):
    """Writes the content of a page to a file; a chunk is written when it is full."""

    def __init__(self, source: Source, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8")
        self._content = PageContent(source)
        self._frames = 0

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame."""
        if number == 0:
            for text in self._content.begin(data, chunk=_CHUNK):
                self._file.write(text)
        self._content.add(data, impulses)
        self._frames = number + 1
        if self._content.waiting == _CHUNK:
            self._flush()

    def finish(self) -> None:
        """Complete the page."""
        if self._content.waiting:
            self._flush()
        pushes = [target.typical_push() for target in self._content.targets.values()]
        self._file.write(json_script('id="end"', {"frames": self._frames, "pushes": pushes}))
        self._file.write("</body>\n</html>\n")
        self._file.close()

    def close(self) -> str:
        """Leave the file, complete or not, and end all recordings."""
        self._content.end()
        return super().close()

    def _flush(self) -> None:
        """Write the frames that wait as a chunk, after the meshes of what moves from now on."""
        chunk = self._content.chunk()
        for number, motion in chunk.motions.items():
            self._file.write(json_script(f'class="motion" data-target="{number}"', motion))
        frames = packed(chunk.content)
        self._file.write(f'<script type="text/plain" class="chunk">{frames}</script>\n')
        self._file.flush()
