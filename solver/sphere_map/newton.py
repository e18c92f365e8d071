"""Global inexact Newton method: all vertices of a level move at once along a conjugate-gradient direction.

The Hessian of each triangle is made positive semidefinite in closed form. With a = (s1 + s2)/2 and b = (s1 - s2)/2,
the energy density is a function of a^2 = D/4 + J/2 and b^2 = D/4 - J/2, and its Hessian splits into a twist (slope
along a over a), a flip (slope along b over b), and a 2 x 2 block in (a, b) (Smith, de Goes, Kim 2019). The step is cut
short of the first fold, then halved until the energy falls enough.
"""

from __future__ import annotations

import numpy as np

from .conjugate_gradients import solve
from .energy import Reference, density, density_derivatives, total_energy
from .level import Level
from .vectors import Floats, Ints, combine, cross, dot, kernel, row, set_row, subtract, tangent_frame

ARMIJO = 1e-4
LONGEST_STEP = 0.7  # [rad]
CG_TOLERANCE = 0.03
CG_STEPS = 60


def newton_step(level: Level, S: Floats, reference: Reference) -> float:
    """Move S by one Newton step in place; return by how much the energy fell (0 where no step lowers it)."""
    frames = np.empty((len(S), 2, 3))
    gradient = np.empty((len(S), 2))
    diagonal = np.empty((len(S), 3))
    blocks = np.empty((len(level.ends), 4))
    energy = _assemble(level.tail, level.edge, level.ends, S, reference, frames, gradient, diagonal, blocks)
    step = solve(level.ends, diagonal, blocks, gradient, CG_STEPS, CG_TOLERANCE)
    descent = -float(np.sum(gradient * step))
    if not descent > 0.0:
        return 0.0
    velocity = np.einsum("ni,nij->nj", step, frames)
    longest = float(np.sqrt(np.max(np.sum(step * step, axis=1))))
    t = min(1.0, 0.9 * _time_of_first_fold(level.tail, S, velocity), LONGEST_STEP / longest)
    for _ in range(12):
        moved = S + t * velocity
        moved /= np.sqrt(np.sum(moved * moved, axis=1, keepdims=True))
        lower = total_energy(level.tail, moved, reference)
        if lower < energy - ARMIJO * t * descent:
            S[:] = moved
            return energy - lower
        t *= 0.5
    return 0.0


@kernel
def _projected_hessian(dirichlet: float, jacobian: float) -> tuple[float, float, float, float, float, float, float]:
    """Slopes W_D and W_J, and the positive semidefinite part of the Hessian of W.

    The latter is `bend_d` hess D + `bend_j` hess J + `dd` gD gD^T + `dj` (gD gJ^T + gJ gD^T) + `jj` gJ gJ^T for the
    gradients gD and gJ.
    """
    _, wd, wj, wdd, wdj, wjj = density_derivatives(dirichlet, jacobian)
    aa, bb = 0.25 * dirichlet + 0.5 * jacobian, max(0.25 * dirichlet - 0.5 * jacobian, 0.0)
    twist, flip = 4.0 * wd + 2.0 * wj, 4.0 * wd - 2.0 * wj
    haa = aa * (16.0 * (wdd + wdj) + 4.0 * wjj) + twist
    hbb = bb * (16.0 * (wdd - wdj) + 4.0 * wjj) + flip
    hab = np.sqrt(aa * bb) * (16.0 * wdd - 4.0 * wjj)
    mean, half = 0.5 * (haa + hbb), 0.5 * (haa - hbb)
    radius = np.sqrt(half * half + hab * hab)
    if mean - radius < 0.0 and radius > 0.0:
        # keep the upper eigenvalue alone: its projector is (1 + (H - mean) / radius) / 2
        upper = max(mean + radius, 0.0)
        haa, hbb = 0.5 * upper * (1.0 + half / radius), 0.5 * upper * (1.0 - half / radius)
        hab = 0.5 * upper * hab / radius
    twist, flip = max(twist, 0.0), max(flip, 0.0)
    along_aa = 0.25 * (haa - twist) / aa
    conformal = bb <= 1e-10 * aa  # b has no direction there
    along_bb = 0.0 if conformal else 0.25 * (hbb - flip) / bb
    along_ab = 0.0 if conformal else 0.25 * hab / np.sqrt(aa * bb)
    dd = (along_aa + 2.0 * along_ab + along_bb) / 16.0
    dj = (along_aa - along_bb) / 8.0
    jj = (along_aa - 2.0 * along_ab + along_bb) / 4.0
    return wd, wj, 0.125 * (twist + flip), 0.25 * (twist - flip), dd, dj, jj


@kernel
def _assemble(
    tail: Ints,
    edge: Ints,
    ends: Ints,
    S: Floats,
    reference: Reference,
    frames: Floats,
    gradient: Floats,
    diagonal: Floats,
    blocks: Floats,
) -> float:
    """Fill tangent frames [n, 2, 3], gradient [n, 2] and Hessian, and return the energy.

    The Hessian has 2 x 2 blocks: `diagonal` [n, 3] with xx, xy, yy, and `blocks` [e, 4] with xx, xy, yx, yy, the rows
    belonging to the edge's first vertex.
    """
    for v in range(len(S)):
        x, y = tangent_frame(row(S, v))
        set_row(frames[v], 0, x)
        set_row(frames[v], 1, y)
    gradient[:] = 0.0
    diagonal[:] = 0.0
    blocks[:] = 0.0
    slope_d, slope_j, radial = np.empty((3, 2)), np.empty((3, 2)), np.zeros(len(S))
    energy = 0.0
    for f in range(len(tail) // 3):
        area, cotangent = reference.area[f], reference.cotangent[3 * f : 3 * f + 3]
        corners = tail[3 * f : 3 * f + 3]
        half = 0.5 / area
        a, b, c = row(S, corners[0]), row(S, corners[1]), row(S, corners[2])
        ab, ac, bc = subtract(b, a), subtract(c, a), subtract(c, b)
        dirichlet = cotangent[0] * dot(bc, bc) + cotangent[1] * dot(ac, ac) + cotangent[2] * dot(ab, ab)
        jacobian = half * dot(a, cross(ab, ac))
        energy += area * density(dirichlet, jacobian)
        wd, wj, bend_d, bend_j, dd, dj, jj = _projected_hessian(dirichlet, jacobian)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            v = corners[i]
            p, q, r = row(S, v), row(S, corners[j]), row(S, corners[k])
            to_q, to_r, wedge = subtract(q, p), subtract(r, p), cross(q, r)
            grad_d = (
                -2.0 * (cotangent[k] * to_q[0] + cotangent[j] * to_r[0]),
                -2.0 * (cotangent[k] * to_q[1] + cotangent[j] * to_r[1]),
                -2.0 * (cotangent[k] * to_q[2] + cotangent[j] * to_r[2]),
            )
            for s in range(2):
                tangent = row(frames[v], s)
                slope_d[i, s] = dot(grad_d, tangent)
                slope_j[i, s] = half * dot(wedge, tangent)
                gradient[v, s] += area * (wd * slope_d[i, s] + wj * slope_j[i, s])
            dx, dy, jx, jy = slope_d[i, 0], slope_d[i, 1], slope_j[i, 0], slope_j[i, 1]
            flat = 2.0 * bend_d * (cotangent[j] + cotangent[k])
            diagonal[v, 0] += area * (flat + dd * dx * dx + 2.0 * dj * dx * jx + jj * jx * jx)
            diagonal[v, 1] += area * (dd * dx * dy + dj * (dx * jy + jx * dy) + jj * jx * jy)
            diagonal[v, 2] += area * (flat + dd * dy * dy + 2.0 * dj * dy * jy + jj * jy * jy)
            radial[v] += area * (wd * dot(grad_d, p) + wj * half * dot(wedge, p))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            u, v, r = corners[i], corners[j], row(S, corners[k])
            e = edge[3 * f + i]
            for s in range(2):
                tangent_u = row(frames[u], s)
                turned = cross(r, tangent_u)
                for t in range(2):
                    tangent_v = row(frames[v], t)
                    value = area * (
                        -2.0 * bend_d * cotangent[k] * dot(tangent_u, tangent_v)
                        + bend_j * half * dot(turned, tangent_v)
                        + dd * slope_d[i, s] * slope_d[j, t]
                        + dj * (slope_d[i, s] * slope_j[j, t] + slope_j[i, s] * slope_d[j, t])
                        + jj * slope_j[i, s] * slope_j[j, t]
                    )
                    blocks[e, 2 * s + t if u == ends[e, 0] else 2 * t + s] += value
    for v in range(len(S)):
        # on the sphere a tangent step also falls towards the centre: the Hessian gains minus the radial slope
        shift = max(-radial[v], 0.0) + 1e-8 * (diagonal[v, 0] + diagonal[v, 2])
        diagonal[v, 0] += shift
        diagonal[v, 2] += shift
    return energy


@kernel
def _time_of_first_fold(tail: Ints, S: Floats, velocity: Floats) -> float:
    """Lower bound on the first time t in (0, 1.2] at which det(a + t a', b + t b', c + t c') of a triangle is zero.

    Infinite where no triangle folds by then.
    """
    horizon = 1.2
    first = np.inf
    for f in range(len(tail) // 3):
        i, j, k = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        p, dp = row(S, i), row(velocity, i)
        e, g = subtract(row(S, j), p), subtract(row(S, k), p)
        de, dg = subtract(row(velocity, j), dp), subtract(row(velocity, k), dp)
        n0, n2 = cross(e, g), cross(de, dg)
        n1 = combine(1.0, cross(de, g), 1.0, cross(e, dg))
        c0, c3 = dot(p, n0), dot(dp, n2)
        c1, c2 = dot(dp, n0) + dot(p, n1), dot(dp, n1) + dot(p, n2)
        if abs(c1) * horizon + abs(c2) * horizon**2 + abs(c3) * horizon**3 < 0.9 * c0:
            continue
        low = high = 0.0
        for s in range(1, 25):
            high = horizon * s / 24
            if c0 + high * (c1 + high * (c2 + high * c3)) <= 0.0:
                for _ in range(12):
                    middle = 0.5 * (low + high)
                    if c0 + middle * (c1 + middle * (c2 + middle * c3)) > 0.0:
                        low = middle
                    else:
                        high = middle
                first = min(first, low)
                break
            low = high
    return first
