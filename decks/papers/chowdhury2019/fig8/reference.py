"""Local elasticity of the plate by bilinear finite elements: writes local.csv (x, y, ux at the 11,960 material points).

The same staircase hole (cells of size dx with |2i + 1| + |2j + 1| <= 40 are void), every cell split into 4 x 4 elements with
2 x 2 Gauss points, plane strain; u_x = +-1e-8 m on the centre lines of the first and last column of cells, where the
deck holds its points. One quarter is computed; the mirror planes supply the rest. Run: python reference.py
"""
import sys

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

LENGTH, YOUNG, POISSON, PULL, SPLIT = 0.15, 200e9, 0.25, 1e-8, 4
DX = LENGTH / 160


def element(h):
    """Stiffness of a square element of plane strain, thickness 1; nodes anticlockwise."""
    lam = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    mu = YOUNG / (2 * (1 + POISSON))
    c = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, mu]])
    k = np.zeros((8, 8))
    for s in np.array([-1, 1]) / np.sqrt(3):
        for t in np.array([-1, 1]) / np.sqrt(3):
            ds = np.array([-(1 - t), 1 - t, 1 + t, -(1 + t)]) / 4 * 2 / h
            dt = np.array([-(1 - s), -(1 + s), 1 + s, 1 - s]) / 4 * 2 / h
            b = np.zeros((3, 8))
            b[0, 0::2] = ds
            b[1, 1::2] = dt
            b[2, 0::2] = dt
            b[2, 1::2] = ds
            k += b.T @ c @ b * h * h / 4
    return k


def solve(split, loaded):
    """Displacement u_x by node (x index, y index) in units of dx / split, and the reaction per thickness."""
    nx, ny = 80 * split, 40 * split
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    solid = 2 * (i // split) + 1 + 2 * (j // split) + 1 > 40
    i, j = i[solid], j[solid]
    node = lambda a, b: a * (ny + 1) + b
    corners = np.stack([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)], axis=1)
    dofs = (2 * corners[:, :, None] + np.arange(2)).reshape(len(i), 8)
    k = element(DX / split)
    n = 2 * (nx + 1) * (ny + 1)
    rows = np.repeat(dofs, 8, axis=1).ravel()
    cols = np.tile(dofs, (1, 8)).ravel()
    stiffness = coo_matrix((np.tile(k.ravel(), len(i)), (rows, cols)), shape=(n, n)).tocsc()
    a, b = np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij")
    u = np.zeros(n)
    held = np.zeros(n, bool)
    held[2 * node(a, b)[0]] = True
    held[2 * node(a, b)[:, 0] + 1] = True
    pulled = 2 * node(a, b)[loaded(a, split)]
    held[pulled] = True
    u[pulled] = PULL
    used = np.zeros(n, bool)
    used[dofs] = True
    free = np.flatnonzero(used & ~held)
    u[free] = splu(stiffness[free][:, free]).solve(-(stiffness[free] @ u))
    reaction = 2 * (stiffness @ u)[pulled].sum()
    return u[0::2].reshape(nx + 1, ny + 1), reaction


CENTRE = lambda a, split: a == 80 * split - split // 2
COLUMN = lambda a, split: a >= 80 * split - split
EDGE = lambda a, split: a == 80 * split


if __name__ == "__main__":
    for name, loaded in (("centre line", CENTRE), ("whole column", COLUMN), ("edge", EDGE)):
        for split in (2, 4) if len(sys.argv) < 2 else (2, 4, 8):
            u, reaction = solve(split, loaded)
            half = split // 2
            print(f"{name}, cells / {split}: reaction {reaction:.3f} N/m, u_x(20, 20) {u[20 * split + half, 20 * split + half]:.6e} m")
    u, _ = solve(SPLIT, CENTRE)
    with open("local.csv", "w") as out:
        out.write("x,y,ux\n")
        for i in range(-80, 80):
            for j in range(-40, 40):
                if abs(2 * i + 1) + abs(2 * j + 1) > 40:
                    p, q = (i if i >= 0 else -1 - i), (j if j >= 0 else -1 - j)
                    value = u[p * SPLIT + SPLIT // 2, q * SPLIT + SPLIT // 2] * (1 if i >= 0 else -1)
                    out.write(f"{(i + 0.5) * DX:.8g},{(j + 0.5) * DX:.8g},{value:.7e}\n")
