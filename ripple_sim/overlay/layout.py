"""`Layout`: sizes of the overlays that follow from the size of a frame."""

from __future__ import annotations

import dataclasses
import math


@dataclasses.dataclass(frozen=True)
class Layout:
    """Sizes of the overlays on frames of one size.

    Parameters
    ----------
    width, height : int
        Of the frame [pixels].
    """

    width: int
    height: int

    @property
    def scale(self) -> float:
        """Size of the frame over the size of a frame of 1280x720."""
        return math.sqrt(self.width * self.height / (1280 * 720))

    @property
    def em(self) -> int:
        """Size of the type [pixels]: 16 on 1280x720, and readable on small frames."""
        return max(9, round(16 * self.scale))

    @property
    def margin(self) -> int:
        """Between the panels and the frame's border, and between panels [pixels]."""
        return round(0.9 * self.em)

    @property
    def arrow_length(self) -> float:
        """Length [pixels] of an arrow at the end of its scale."""
        return 115.0 * self.scale

    @property
    def arrow_thickness(self) -> float:
        """Thickness [pixels] of an arrow's shaft."""
        return max(2.6 * self.scale, 1.3)

    def panel_width(self, ems: float) -> int:
        """Width of a panel [pixels]; two panels must fit side by side."""
        return min(round(ems * self.em), (self.width - 3 * self.margin) // 2)

    def place(self, corner: str, width: int, height: int) -> tuple[int, int]:
        """Left and top [pixels] of a panel of a width and height [pixels].

        `corner` is a corner of the frame, such as "bottom left", or an edge, such as "top", in
        whose middle the panel stands.
        """
        left = (self.width - width) // 2
        if "left" in corner:
            left = self.margin
        elif "right" in corner:
            left = self.width - self.margin - width
        top = self.margin if "top" in corner else self.height - self.margin - height
        return left, top
