"""Ripples for Gymnasium's MuJoCo environments."""

try:
    import gymnasium as gymnasium
except ImportError as error:
    raise ImportError(
        "ripple_sim.gymnasium needs Gymnasium, which is not installed; install it with: "
        "pip install 'ripple-sim[gymnasium]'"
    ) from error

from .wrapper import RippleWrapper

__all__ = ["RippleWrapper"]
