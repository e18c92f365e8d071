"""The Hessian of one triangle's energy density, made positive semidefinite.

With a = (s1 + s2)/2 and b = (s1 - s2)/2, the energy density is a function of a^2 = D/4 + J/2 and b^2 = D/4 - J/2, and
its Hessian splits into a twist (slope along a over a), a flip (slope along b over b), and a 2 x 2 block in (a, b)
(Smith, de Goes, Kim 2019). Each of them loses its negative part in closed form.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ...kernel import kernel
from .energy import density_derivatives

# W_D and W_J; then the Hessian is the second of D, the second of J, and gD gD^T, gD gJ^T + gJ gD^T and gJ gJ^T with the
# gradients gD and gJ, in these shares
Shares: TypeAlias = tuple[float, float, float, float, float, float, float]


@kernel
def projected_hessian(area: float, dirichlet: float, jacobian: float) -> tuple[float, Shares]:
    """Energy of a triangle of the given area, and the shares that make up its Hessian's positive part."""
    w, wd, wj, wdd, wdj, wjj = density_derivatives(dirichlet, jacobian)
    aa, bb = 0.25 * dirichlet + 0.5 * jacobian, max(0.25 * dirichlet - 0.5 * jacobian, 0.0)
    twist, flip = 4.0 * wd + 2.0 * wj, 4.0 * wd - 2.0 * wj
    haa = aa * (16.0 * (wdd + wdj) + 4.0 * wjj) + twist
    hbb = bb * (16.0 * (wdd - wdj) + 4.0 * wjj) + flip
    root = np.sqrt(aa * bb)
    hab = root * (16.0 * wdd - 4.0 * wjj)
    if haa < 0.0 or hbb < 0.0 or haa * hbb < hab * hab:
        # keep the upper eigenvalue alone: its projector is (1 + (H - mean) / radius) / 2
        mean, half = 0.5 * (haa + hbb), 0.5 * (haa - hbb)
        radius = np.sqrt(half * half + hab * hab)
        upper = max(mean + radius, 0.0)
        turn = half / radius if radius > 0.0 else 0.0
        haa, hbb = 0.5 * upper * (1.0 + turn), 0.5 * upper * (1.0 - turn)
        hab = 0.5 * upper * hab / radius if radius > 0.0 else 0.0
    twist, flip = max(twist, 0.0), max(flip, 0.0)
    along_aa = 0.25 * (haa - twist) / aa
    along_bb = along_ab = 0.0
    if bb > 1e-10 * aa:  # else b has no direction
        along_bb, along_ab = 0.25 * (hbb - flip) / bb, 0.25 * hab / root
    dd = (along_aa + 2.0 * along_ab + along_bb) / 16.0
    dj = (along_aa - along_bb) / 8.0
    jj = (along_aa - 2.0 * along_ab + along_bb) / 4.0
    bend_d, bend_j = 0.125 * (twist + flip), 0.25 * (twist - flip)
    return area * w, (area * wd, area * wj, area * bend_d, area * bend_j, area * dd, area * dj, area * jj)
