"""The plate with an edge crack at rest, by correspondence and by finite elements. Run: python reference.py

40 x 40 points of spacing 1, E = 1, nu = 1/4, plane strain, crack from the left edge along y = 20 to x = 20.3; u_y = +-1e-3 on the first and
last row. Printed: reaction per thickness, opening of the crack at its mouth (first column, rows beside the crack).
"""
import sys

import numpy as np
from scipy.sparse import coo_matrix

sys.path.insert(0, "..")
from correspondence import assemble, families, full, gradients, orthants, sectors, solve, stiffness_tensor

N, TIP, PULL = 40, 20.3, 1e-3


def cut(x, near):
    """Families without the bonds that cross the crack."""
    result = []
    for i, family in enumerate(near):
        a, b = x[i], x[family]
        crosses = (a[1] - N / 2) * (b[:, 1] - N / 2) < 0
        with np.errstate(divide="ignore", invalid="ignore"):
            place = a[0] + (b[:, 0] - a[0]) * (N / 2 - a[1]) / (b[:, 1] - a[1])
        result.append(family[~(crosses & (place < TIP))])
    return result


def local(split):
    """Finite elements, cells split; nodes on the crack are doubled. The tip moves to the nearest node."""
    n = N * split
    h = 1 / split
    c = stiffness_tensor(1.0, 0.25, 2)
    k = np.zeros((8, 8))
    for s in np.array([-1, 1]) / np.sqrt(3):
        for t in np.array([-1, 1]) / np.sqrt(3):
            g = np.array([[-(1 - t), 1 - t, 1 + t, -(1 + t)], [-(1 - s), -(1 + s), 1 + s, 1 - s]]).T / 2 / h
            k += np.einsum("pj,ijkl,ql->piqk", g, c, g).reshape(8, 8) * h * h / 4
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    tip = round(TIP * split)
    node = lambda a, b, upper: np.where((b == n // 2) & (a < tip) & upper, (n + 1) ** 2 + a, a * (n + 1) + b)
    upper = j >= n // 2
    corners = np.stack([node(i, j, upper), node(i + 1, j, upper), node(i + 1, j + 1, upper), node(i, j + 1, upper)], 1)
    dofs = (2 * corners[:, :, None] + np.arange(2)).reshape(len(i), 8)
    size = 2 * ((n + 1) ** 2 + tip)
    stiffness = coo_matrix((np.tile(k.ravel(), len(i)), (np.repeat(dofs, 8, 1).ravel(), np.tile(dofs, (1, 8)).ravel())), shape=(size, size)).tocsc()
    held = {}
    a = np.arange(n + 1)
    row = split // 2
    for p in a:
        held[2 * (p * (n + 1) + row) + 1] = -PULL
        held[2 * (p * (n + 1) + n - row) + 1] = PULL
    held[2 * (n * (n + 1) + row)] = 0.0
    u, f = solve(stiffness, held)
    reaction = sum(f[2 * (p * (n + 1) + n - row) + 1] for p in a)
    mouth = lambda b: u[2 * (row * (n + 1) + b) + 1]
    return reaction, mouth(n // 2 + row) - mouth(n // 2 - row)


if __name__ == "__main__":
    for split in (2, 4):
        print(f"local, cells / {split}: reaction {local(split)[0]:.6e}, opening {local(split)[1]:.6e}")
    i, j = (a.ravel() for a in np.meshgrid(np.arange(N), np.arange(N), indexing="ij"))
    x = np.stack([i, j], 1) + 0.5
    volume = np.ones(len(x))
    c = stiffness_tensor(1.0, 0.25, 2)
    held = {2 * p + 1: (-PULL if j[p] == 0 else PULL) for p in range(len(x)) if j[p] in (0, N - 1)}
    held[2 * int(np.flatnonzero((i == N - 1) & (j == 0))[0])] = 0.0
    place = {(a, b): p for p, (a, b) in enumerate(zip(i, j))}
    for horizon in (1.1 * np.sqrt(2), 3.015):
        near = cut(x, families(x, horizon))
        for name, split, wan in (("conventional", full, False), ("Wan", full, True), ("quadrants", orthants, False), ("3 sectors", sectors(3), False)):
            rows, dropped, whole = gradients(x, volume, near, split, 1e-2)
            u, f = solve(assemble(x, volume, rows, c, wan), held)
            uy = u[1::2]
            reaction = sum(f[2 * place[a, N - 1] + 1] for a in range(N))
            opening = uy[place[0, N // 2]] - uy[place[0, N // 2 - 1]]
            third = np.diff(uy.reshape(N, N), 3, axis=0)
            print(f"{horizon:.3f} {name}: reaction {reaction:.7e}, opening {opening:.7e}, rough3 of u_y {np.sqrt(np.mean(third**2)) / 8:.4e}, dropped {dropped}, whole {whole}", flush=True)
