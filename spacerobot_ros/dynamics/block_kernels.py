"""Compiled loops of the momentum-block regressor: its columns, blocks and their changes.

Symbols as in `blocks`: N samples, b = n + 1 bodies, P pairs of bodies, m = 3 + n rates.
"""

from __future__ import annotations

import numpy as np

from ..types import Array, IntArray
from .compiling import Triple, compiled, inner
from .forward_kinematics import forward_kinematics
from .spatial import add, cross, dot, get, plus, put, rotate, times
from .tree import Records


# Vectorised over samples NumPy needs 7 us a sample-row here (strided temporaries of 9 columns a
# pair of bodies); compiled it is 0.15 us on one core.
@compiled  # type: ignore[untyped-decorator]
def fill_regressor(rotations: Array, w: Array, pairs: IntArray, out: Array) -> None:
    """Write the regressor's columns, bodies' blocks first and pairs' blocks behind.

    Args:
        rotations: (N, b, 3, 3) body to base coordinates.
        w: (N, b, 3) angular velocities in base coordinates [rad/s].
        pairs: (P, 2) indices k < m of the pairs of bodies.
        out: (N, 3, 6 b + 9 P) written.
    """
    bodies = rotations.shape[1]
    for s in range(rotations.shape[0]):
        for k in range(bodies):
            _fill_body(rotations, w, s, k, out)
        for p in range(pairs.shape[0]):
            _fill_pair(rotations, w, s, pairs[p, 0], pairs[p, 1], 6 * bodies + 9 * p, out)


# Whole arrays and indices are passed: views of them would cost more than the arithmetic.
@inner  # type: ignore[untyped-decorator]
def _fill_body(R: Array, w: Array, s: int, k: int, out: Array) -> None:
    """Columns of J_k: e_a (e_b . w), and e_b (e_a . w) too where a and b differ."""
    x = R[s, k, 0, 0] * w[s, k, 0] + R[s, k, 1, 0] * w[s, k, 1] + R[s, k, 2, 0] * w[s, k, 2]
    y = R[s, k, 0, 1] * w[s, k, 0] + R[s, k, 1, 1] * w[s, k, 1] + R[s, k, 2, 1] * w[s, k, 2]
    z = R[s, k, 0, 2] * w[s, k, 0] + R[s, k, 1, 2] * w[s, k, 1] + R[s, k, 2, 2] * w[s, k, 2]
    for i in range(3):
        out[s, i, 6 * k] = R[s, k, i, 0] * x
        out[s, i, 6 * k + 1] = R[s, k, i, 1] * y
        out[s, i, 6 * k + 2] = R[s, k, i, 2] * z
        out[s, i, 6 * k + 3] = R[s, k, i, 0] * y + R[s, k, i, 1] * x
        out[s, i, 6 * k + 4] = R[s, k, i, 0] * z + R[s, k, i, 2] * x
        out[s, i, 6 * k + 5] = R[s, k, i, 1] * z + R[s, k, i, 2] * y


@inner  # type: ignore[untyped-decorator]
def _fill_pair(R: Array, w: Array, s: int, k: int, m: int, start: int, out: Array) -> None:
    """Columns of Q_km: e_ka x (w_m x e_mb) + e_mb x (w_k x e_ka), the triple products expanded."""
    for a in range(3):
        for b in range(3):
            dot, along_m, along_k = 0.0, 0.0, 0.0
            for i in range(3):
                dot += R[s, k, i, a] * R[s, m, i, b]
                along_m += R[s, k, i, a] * w[s, m, i]
                along_k += R[s, m, i, b] * w[s, k, i]
            for i in range(3):
                turning = (w[s, k, i] + w[s, m, i]) * dot
                column = turning - R[s, m, i, b] * along_m - R[s, k, i, a] * along_k
                out[s, i, start + 3 * a + b] = column


@compiled  # type: ignore[untyped-decorator]
def fill_parameters(
    mass: Array, com: Array, inertia: Array, links: Array, pairs: IntArray, out: Array
) -> None:
    """Write block parameters: J of all bodies (xx, yy, zz, xy, xz, yz), then Q of pairs.

    Args:
        mass: (S, b).
        com: (S, b, 3).
        inertia: (S, b, 3, 3).
        links: (b, b, 3) g_ik of every body i and another body k.
        pairs: (P, 2) indices k < m of the pairs of bodies.
        out: (S, 6 b + 9 P) written.
    """
    bodies, first, q = mass.shape[1], np.empty((mass.shape[1], 3)), np.empty((3, 3))
    for s in range(len(mass)):
        arms = links.copy()
        first[:] = 0.0
        for k in range(bodies):
            arms[k, k] = com[s, k]
            for i in range(bodies):
                for a in range(3):
                    first[k, a] += mass[s, i] * arms[i, k, a]
        for k in range(bodies):
            _second_moments(mass[s], arms, first, k, k, q)
            trace = q[0, 0] + q[1, 1] + q[2, 2]
            for a in range(3):
                out[s, 6 * k + a] = inertia[s, k, a, a] + trace - q[a, a]
                i, j = (0, 1) if a == 0 else (0, 2) if a == 1 else (1, 2)
                out[s, 6 * k + 3 + a] = inertia[s, k, i, j] - q[i, j]
        for p in range(len(pairs)):
            _second_moments(mass[s], arms, first, pairs[p, 0], pairs[p, 1], q)
            for a in range(9):
                out[s, 6 * bodies + 9 * p + a] = q[a // 3, a % 3]


@inner  # type: ignore[untyped-decorator]
def _second_moments(mass: Array, arms: Array, first: Array, k: int, m: int, out: Array) -> None:
    """Write Q_km = sum_i m_i g_ik g_im^T - psi_k psi_m^T / M."""
    for a in range(3):
        for b in range(3):
            total = 0.0
            for i in range(len(mass)):
                total += mass[i] * arms[i, k, a] * arms[i, m, b]
            out[a, b] = total - first[k, a] * first[m, b] / mass.sum()


@compiled  # type: ignore[untyped-decorator]
def fill_blocks(R: Array, pi: Array, pairs: IntArray, out: Array) -> None:
    """Write the blocks: R_k J_k R_k^T, and tr(G) 1 - G^T of pairs.

    Args:
        R: (N, b, 3, 3) body to base coordinates.
        pi: (K,) block parameters.
        pairs: (P, 2) indices k < m of the pairs of bodies.
        out: (N, b, b, 3, 3) written.
    """
    bodies = R.shape[1]
    part, turned = np.empty((3, 3)), np.empty((3, 3))
    for s in range(R.shape[0]):
        for k in range(bodies):
            xx, yy, zz, xy, xz, yz = pi[6 * k : 6 * k + 6]
            part[0, 0], part[1, 1], part[2, 2] = xx, yy, zz
            part[0, 1], part[0, 2], part[1, 2] = xy, xz, yz
            part[1, 0], part[2, 0], part[2, 1] = xy, xz, yz
            _turn(R, s, k, k, part, out[s, k, k])
        for p in range(pairs.shape[0]):
            k, m, start = pairs[p, 0], pairs[p, 1], 6 * bodies + 9 * p
            for a in range(9):
                part[a // 3, a % 3] = pi[start + a]
            _turn(R, s, k, m, part, turned)
            trace = turned[0, 0] + turned[1, 1] + turned[2, 2]
            for i in range(3):
                for j in range(3):
                    out[s, k, m, i, j] = -turned[j, i]
                    out[s, m, k, i, j] = -turned[i, j]
                out[s, k, m, i, i] += trace
                out[s, m, k, i, i] += trace


@inner  # type: ignore[untyped-decorator]
def _turn(R: Array, s: int, k: int, m: int, part: Array, out: Array) -> None:
    """Write R_k part R_m^T."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += R[s, k, i, a] * part[a, b] * R[s, m, j, b]
            out[i, j] = total


@compiled  # type: ignore[untyped-decorator]
def fill_changes(B: Array, maps: Array, u: Array, moves: Array, out: Array) -> None:
    """Write dM/dq_j u of M = P^T B P, a term for each factor.

    Args:
        B: (N, b, b, 3, 3) blocks.
        maps: (N, b, 3, m) P_k with w_k = P_k u.
        u: (N, m) body rate and joint rates [rad/s].
        moves: (n, b) 1 where a joint moves a body, else 0.
        out: (N, n, m) zeros, written.
    """
    joints, bodies = moves.shape
    w, slip, momentum = np.empty((bodies, 3)), np.empty((bodies, 3)), np.empty((bodies, 3))
    for s in range(maps.shape[0]):
        w[:], momentum[:] = 0.0, 0.0
        for k in range(bodies):
            for r in range(3 + joints):
                add(w[k], 0, times(u[s, r], _column(maps, s, k, r)))
        for k in range(bodies):
            for m in range(bodies):
                add(momentum[k], 0, rotate(B[s, k, m], get(w[m], 0)))
        for j in range(joints):
            axis = _column(maps, s, j + 1, 3 + j)
            _slip(maps, u, moves, s, j, (slip, momentum), out)
            for k in range(bodies):
                change = 0.0, 0.0, 0.0
                for m in range(bodies):
                    moved = moves[j, k], moves[j, m]
                    change = plus(change, _turned(B[s, k, m], axis, get(w[m], 0), moved))
                    change = plus(change, rotate(B[s, k, m], get(slip[m], 0)))
                for r in range(3 + joints):
                    out[s, j, r] += dot(_column(maps, s, k, r), change)


@inner  # type: ignore[untyped-decorator]
def _column(maps: Array, s: int, k: int, r: int) -> Triple:
    return maps[s, k, 0, r], maps[s, k, 1, r], maps[s, k, 2, r]


@inner  # type: ignore[untyped-decorator]
def _slip(
    maps: Array, u: Array, moves: Array, s: int, j: int, bodies: tuple[Array, Array], out: Array
) -> None:
    """Write how bodies' rates change as joint j turns other axes; add what their momentum does."""
    slip, momentum = bodies
    axis, slip[:] = _column(maps, s, j + 1, 3 + j), 0.0
    for i in range(moves.shape[0]):
        across = cross(axis, _column(maps, s, i + 1, 3 + i))
        for k in range(moves.shape[1]):
            moved = moves[j, i + 1] * moves[i, k]
            add(slip[k], 0, times(moved * u[s, 3 + i], across))
            out[s, j, 3 + i] += moved * dot(across, get(momentum[k], 0))


@inner  # type: ignore[untyped-decorator]
def _turned(B: Array, axis: Triple, w: Triple, moved: tuple[float, float]) -> Triple:
    """Change of a block B_km times w as a joint turns: by whether it has moved body k and body m.

    With G^T = tr(B)/2 1 - B it is by_m a x B w - by_k B (a x w) - (by_m - by_k) (tr(a^x B) w +
    tr(B)/2 a x w).
    """
    by_k, by_m = moved
    across = cross(axis, w)
    trace = B[0, 0] + B[1, 1] + B[2, 2]
    twist = dot(axis, (B[1, 2] - B[2, 1], B[2, 0] - B[0, 2], B[0, 1] - B[1, 0]))
    both = plus(times(by_m, cross(axis, rotate(B, w))), times(-by_k, rotate(B, across)))
    return plus(both, times(by_k - by_m, plus(times(twist, w), times(0.5 * trace, across))))


@compiled  # type: ignore[untyped-decorator]
def equation_of_rates(
    geometry: tuple[Records, Array, Array, IntArray],
    q: Array,
    u: Array,
    pi: Array,
    wheels: Array,
    joint_reaction: bool,
) -> Array:
    """M and bias of `BlockTree.equation`: (N, m, m + 1).

    One state takes 12 us, with NumPy around the loops above 150 us (three joints, CPU time).

    Args:
        geometry: `BODY` records, joints' axes (n, 3) in their bodies, which joints (n, b) move
            which bodies, and pairs (P, 2) of bodies.
        q: (N, n) joint positions.
        u: (N, m) body rate and joint rates.
        pi: (K,) block parameters.
        wheels: (b, 3) momentum of the wheels of every body, in its axes.
        joint_reaction: Whether that loads the joints.
    """
    tree, axes, moves, pairs = geometry
    count, joints, bodies, m = len(q), len(axes), len(wheels), u.shape[1]
    rotations = forward_kinematics(tree, q, np.zeros((count, 6 + joints)), q).rotations
    maps, blocks = np.zeros((count, bodies, 3, m)), np.empty((count, bodies, bodies, 3, 3))
    changes, out = np.zeros((count, joints, m)), np.zeros((count, m, m + 1))
    for s in range(count):
        _fill_maps(rotations[s], axes, moves, maps[s])
    fill_blocks(rotations, pi, pairs, blocks)
    fill_changes(blocks, maps, u, moves, changes)
    for s in range(count):
        M, bias = out[s, :, :-1], out[s, :, -1]
        _fill_inertia(blocks[s], maps[s], M)
        for j in range(joints):
            for r in range(m):
                bias[r] += u[s, 3 + j] * changes[s, j, r]
                bias[3 + j] -= 0.5 * changes[s, j, r] * u[s, r]
        momentum = 0.0, 0.0, 0.0
        for r in range(m):
            momentum = plus(momentum, times(u[s, r], (M[0, r], M[1, r], M[2, r])))
        add(bias, 0, cross(get(u[s], 0), momentum))
        for k in range(bodies):
            _add_wheels(rotations[s, k], maps[s, k], u[s], wheels[k], joint_reaction, bias)
    return out


@inner  # type: ignore[untyped-decorator]
def _fill_maps(R: Array, axes: Array, moves: Array, maps: Array) -> None:
    """Write the maps P_k (b, 3, m), as `BlockTree.rate_maps`, over zeros."""
    for k in range(len(maps)):
        for r in range(3):
            maps[k, r, r] = 1.0
        for j in range(len(axes)):
            put(maps[k, :, 3 + j], 0, times(moves[j, k], rotate(R[j + 1], get(axes[j], 0))))


@inner  # type: ignore[untyped-decorator]
def _fill_inertia(B: Array, maps: Array, M: Array) -> None:
    """Add P^T B P of blocks (b, b, 3, 3) and maps (b, 3, m)."""
    bodies, m = maps.shape[0], maps.shape[2]
    for r in range(m):
        for k in range(bodies):
            part = 0.0, 0.0, 0.0
            for i in range(bodies):
                rate = maps[i, 0, r], maps[i, 1, r], maps[i, 2, r]
                part = plus(part, rotate(B[k, i], rate))
            for c in range(m):
                M[c, r] += dot((maps[k, 0, c], maps[k, 1, c], maps[k, 2, c]), part)


@inner  # type: ignore[untyped-decorator]
def _add_wheels(
    R: Array, maps: Array, u: Array, wheels: Array, joint_reaction: bool, bias: Array
) -> None:
    """Add the gyroscopic torque of one body's wheels."""
    rate = 0.0, 0.0, 0.0
    for r in range(len(u)):
        rate = plus(rate, times(u[r], (maps[0, r], maps[1, r], maps[2, r])))
    torque = cross(rate, rotate(R, get(wheels, 0)))
    for r in range(len(u) if joint_reaction else 3):
        bias[r] += dot((maps[0, r], maps[1, r], maps[2, r]), torque)
