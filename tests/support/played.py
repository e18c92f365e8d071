"""What tests of the viewer share."""

import numpy as np

from ripple_sim.viewer.session import Session

RADIUS, MIDDLE = 0.5, np.array([0.0, 0.0, 0.5])  # of the scene "sphere" [m]


def run(session: Session, frames: int) -> None:
    for _ in range(frames):
        session.advance()
