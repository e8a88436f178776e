"""The block by an independent computation, and rough3 along its rows. Run: python reference.py"""
import sys

import numpy as np

sys.path.insert(0, "..")
from correspondence import assemble, families, full, gradients, orthants, solve, stiffness_tensor

NX, NY, NZ, PULL = 12, 8, 8, 1e-3


def block():
    """Cell centres of 12 x 8 x 8 unit cells with a hole of 4 x 4 cells along z: ligaments of two points."""
    cells = [(i, j, k) for i in range(NX) for j in range(NY) for k in range(NZ) if not (4 <= i < 8 and 2 <= j < 6)]
    return np.array(cells)


def rough3(cells, ux):
    place = {tuple(c): n for n, c in enumerate(cells)}
    third = []
    for i, j, k in cells:
        row = [place.get((i + m, j, k)) for m in range(4)]
        if None not in row:
            a, b, c, d = ux[row]
            third.append(d - 3 * c + 3 * b - a)
    return np.sqrt(np.mean(np.square(third))) / 8 / PULL


if __name__ == "__main__":
    cells = block()
    x = cells + 0.5
    volume = np.ones(len(x))
    c = stiffness_tensor(1.0, 0.25, 3)
    held = {}
    for n, (i, j, k) in enumerate(cells):
        if i in (0, NX - 1):
            held[3 * n] = -PULL if i == 0 else PULL
    # corners of the first layer: no rigid motion
    place = {tuple(c): n for n, c in enumerate(cells)}
    for key, axes in (((0, 0, 0), (1, 2)), ((0, 7, 0), (2,))):
        for a in axes:
            held[3 * place[key] + a] = 0.0
    for horizon in (1.1 * np.sqrt(3), 1.1, 2.1, 3.1):
        near = families(x, horizon)
        for name, split, wan in (("conventional", full, False), ("octants", orthants, False), ("Wan", full, True)):
            rows, dropped, whole = gradients(x, volume, near, split, 1e-2)
            k = assemble(x, volume, rows, c, wan)
            u, f = solve(k, held)
            reaction = sum(f[3 * n] for n, cell in enumerate(cells) if cell[0] == NX - 1)
            there = u[3 * place[(5, 1, 4)]]
            print(f"{horizon:.3f} {name}: reaction {reaction:.6e}, u_x at (5.5, 1.5, 4.5) {there:.6e}, rough3 {rough3(cells, u[0::3]):.3e}, dropped {dropped}, full family {whole}", flush=True)
