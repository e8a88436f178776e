"""The plate by correspondence, full families and quadrants, in NumPy and SciPy: the numbers that the decks expect.

Small strain, influence 1, closed balls, bonds across the hole kept. Sub-horizons whose shape tensor has an eigenvalue ratio
below 1e-2 are dropped and the others carry the energy. Run: python plate.py [ratio ...] (a few seconds to a minute each)
"""
import sys
import time

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu

from reference import DX, POISSON, PULL, YOUNG

LAM = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
MU = YOUNG / (2 * (1 + POISSON))
KINDS = {
    "conventional": [lambda x, y: np.full(x.shape, True)],
    "closed quadrants": [lambda x, y, s=s, t=t: (s * x >= 0) & (t * y >= 0) for s in (1, -1) for t in (1, -1)],
    "open quadrants": [lambda x, y, s=s, t=t: (s * x > 0) & (t * y > 0) for s in (1, -1) for t in (1, -1)],
    "half-open quadrants": [
        lambda x, y: (x > 0) & (y >= 0),
        lambda x, y: (x <= 0) & (y > 0),
        lambda x, y: (x < 0) & (y <= 0),
        lambda x, y: (x >= 0) & (y < 0),
    ],
}


def points():
    i, j = np.meshgrid(np.arange(-80, 80), np.arange(-40, 40), indexing="ij")
    keep = abs(2 * i + 1) + abs(2 * j + 1) > 40
    return i[keep], j[keep]


def covered(i, j, a, b, reach=0.999, steps=2000):
    """Whether every place of the segments (i, j) to (i + a, j + b) lies within `reach` spacings of a point."""
    index = np.zeros((180, 100), bool)
    index[i + 90, j + 50] = True
    seen = np.full(len(i), True)
    near = np.flatnonzero(np.abs(i + 0.5) + np.abs(j + 0.5) < 26)
    t = np.arange(steps + 1) / steps
    x, y = i[near, None] + t * a, j[near, None] + t * b
    close = np.full(x.shape, False)
    for s in (-1, 0, 1, 2):
        for q in (-1, 0, 1, 2):
            p, r = np.floor(x).astype(int) + s, np.floor(y).astype(int) + q
            close |= index[p + 90, r + 50] & (np.hypot(x - p, y - r) <= reach)
    seen[near] = close.all(axis=1)
    return seen


def diamond(i, j, a, b, half=20.0):
    """Whether the segments stay out of the diamond |x| + |y| < half (in spacings): its edges are where a corner of the sum lies."""
    x, y = i + 0.5, j + 0.5
    t = [np.zeros(len(i)), np.ones(len(i))]
    t += [np.clip(-x / a, 0, 1)] if a else []
    t += [np.clip(-y / b, 0, 1)] if b else []
    return np.min([np.abs(x + s * a) + np.abs(y + s * b) for s in t], axis=0) >= half - 1e-9


def gradients(i, j, ratio, kind, sees=None):
    """Rows of d/dx and d/dy for every sub-horizon of every point, and the weight 1/N_SH of each row; `sees` keeps bonds."""
    index = -np.ones((160, 80), int)
    index[i + 80, j + 40] = np.arange(len(i))
    reach = ratio * np.sqrt(2) * (1 + 1e-9)
    m = int(reach)
    a, b = np.meshgrid(np.arange(-m, m + 1), np.arange(-m, m + 1), indexing="ij")
    inside = (a**2 + b**2 <= reach**2) & ((a != 0) | (b != 0))
    a, b = a[inside], b[inside]
    p, q = i[:, None] + a + 80, j[:, None] + b + 40
    there = (p >= 0) & (p < 160) & (q >= 0) & (q < 80)
    other = np.where(there, index[np.clip(p, 0, 159), np.clip(q, 0, 79)], -1)
    if sees is not None:
        for k in range(len(a)):
            other[~sees(i, j, a[k], b[k]), k] = -1
    rows = []
    for member in KINDS[kind]:
        w = ((other >= 0) & member(a, b)).astype(float)
        k11, k22, k12 = w @ (a * a), w @ (b * b), w @ (a * b)
        mean, radius = (k11 + k22) / 2, np.hypot((k11 - k22) / 2, k12)
        good = mean - radius > 1e-2 * (mean + radius)
        det = np.where(good, k11 * k22 - k12**2, 1)
        gx = w * (k22[:, None] * a - k12[:, None] * b) / det[:, None] / DX
        gy = w * (k11[:, None] * b - k12[:, None] * a) / det[:, None] / DX
        rows.append((good, gx, gy))
    number = sum(good for good, _, _ in rows)
    if number.min() == 0:
        raise ValueError(f"{np.sum(number == 0)} points have no sub-horizon of rank 2")
    return other, rows, number


def sparse(other, good, g):
    n = len(good)
    r, c = np.nonzero((other >= 0) & good[:, None] & (g != 0))
    row = csr_matrix((g[r, c], (r, other[r, c])), shape=(n, n))
    return row - csr_matrix((np.asarray(row.sum(axis=1)).ravel(), (range(n), range(n))), shape=(n, n))


def solve(ratio, kind, sees=None):
    i, j = points()
    n = len(i)
    other, rows, number = gradients(i, j, ratio, kind, sees)
    xx = xy = yy = yx = 0
    for good, gx, gy in rows:
        w = np.where(good, DX * DX / number, 0)
        dx, dy = sparse(other, good, gx), sparse(other, good, gy)
        wx, wy = dx.multiply(w[:, None]).tocsr(), dy.multiply(w[:, None]).tocsr()
        xx = xx + (LAM + 2 * MU) * (dx.T @ wx) + MU * (dy.T @ wy)
        yy = yy + (LAM + 2 * MU) * (dy.T @ wy) + MU * (dx.T @ wx)
        xy = xy + LAM * (dx.T @ wy) + MU * (dy.T @ wx)
        yx = yx + LAM * (dy.T @ wx) + MU * (dx.T @ wy)
    # unknowns interleaved; points are already sorted by column, which keeps the factors narrow
    parts = [[p.tocoo() for p in row] for row in ((xx, xy), (yx, yy))]
    r = np.concatenate([2 * parts[s][t].row + s for s in (0, 1) for t in (0, 1)])
    c = np.concatenate([2 * parts[s][t].col + t for s in (0, 1) for t in (0, 1)])
    v = np.concatenate([parts[s][t].data for s in (0, 1) for t in (0, 1)])
    k = coo_matrix((v, (r, c)), shape=(2 * n, 2 * n)).tocsr()
    u = np.zeros(2 * n)
    left, right = 2 * np.flatnonzero(i == -80), 2 * np.flatnonzero(i == 79)
    u[left], u[right] = -PULL, PULL
    held = np.zeros(2 * n, bool)
    held[left] = held[right] = True
    held[2 * np.flatnonzero((i == -80) & (j == 0)) + 1] = True
    free = np.flatnonzero(~held)
    lu = splu(k[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    f = -(k[free] @ u)
    u[free] = lu.solve(f)
    u[free] += lu.solve(-(k[free] @ u))
    return i, j, u[0::2], (k @ u)[right].sum()


def rough3(i, j, ux):
    """Root mean square of the third differences along rows of neighbours, over 8 and the pull."""
    grid = np.full((160, 80), np.nan)
    grid[i + 80, j + 40] = ux
    third = grid[3:] - 3 * grid[2:-1] + 3 * grid[1:-2] - grid[:-3]
    return np.sqrt(np.nanmean(third**2)) / 8 / PULL


if __name__ == "__main__":
    local = np.loadtxt("local.csv", delimiter=",", skiprows=1)[:, 2]
    i, j = points()
    print(f"local: rough3 {rough3(i, j, local):.2e}")
    for ratio in [float(a) for a in sys.argv[1:]] or (1.1, 2.1, 3.1):
        for kind in KINDS:
            start = time.time()
            try:
                i, j, ux, reaction = solve(ratio, kind)
            except ValueError as error:
                print(f"{ratio} {kind}: {error}")
                continue
            distance = np.linalg.norm(ux - local) / np.linalg.norm(local)
            here = ux[(i == 20) & (j == 20)][0]
            print(
                f"{ratio} {kind}: reaction {reaction:.3f} N/m, u_x(20, 20) {here:.6e} m, rough3 {rough3(i, j, ux):.2e}, "
                f"L2 to local {distance:.3e} ({time.time() - start:.0f} s)",
                flush=True,
            )
    for name, sees in (("balls of 0.999 spacings", covered), ("the diamond of half diagonal H/4", diamond)):
        _, _, _, reaction = solve(3.1, "closed quadrants", sees)
        print(f"3.1 closed quadrants, bonds cut by {name}: reaction {reaction:.3f} N/m")
