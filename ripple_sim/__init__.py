"""Surface ripples on any genus-0 mesh, driven by the contact forces of a MuJoCo simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .coupling import Impulse, Ripples
    from .solver import Material, RippleError

__version__ = "0.1.0"
__all__ = ["Impulse", "Material", "RippleError", "Ripples"]


def __getattr__(name: str) -> Any:
    # loaded when first used: importing ripple_sim must stay quick
    if name in ("Impulse", "Ripples"):
        from . import coupling as home
    elif name in ("Material", "RippleError"):
        from . import solver as home
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; valid are {', '.join(__all__)}")
    return getattr(home, name)
