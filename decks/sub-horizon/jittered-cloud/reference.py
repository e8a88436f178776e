"""A jittered cloud of 16 x 16 points: writes cloud.csv and prints the lowest elastic eigenvalues of the free body.

Every point of the unit lattice is shifted by up to 0.4 along each axis and has a volume between 0.8 and 1.2; E = rho = 1,
nu = 1/4, plane strain. The local value is that of the square by bilinear finite elements. Run: python reference.py
"""
import sys

import numpy as np
from scipy.linalg import eigh

sys.path.insert(0, "..")
from correspondence import assemble, families, full, gradients, orthants, sectors, stiffness_tensor

N = 16


def cloud():
    random = np.random.default_rng(2019)
    i, j = np.meshgrid(np.arange(N), np.arange(N), indexing="ij")
    x = np.stack([i.ravel(), j.ravel()], axis=1) + 0.5 + random.uniform(-0.4, 0.4, (N * N, 2))
    return np.round(x, 6), np.round(random.uniform(0.8, 1.2, N * N), 6)


def local(n, c):
    """First elastic eigenvalue of the free square, n x n bilinear elements."""
    h = N / n
    k, m = np.zeros((8, 8)), np.zeros((8, 8))
    for s in np.array([-1, 1]) / np.sqrt(3):
        for t in np.array([-1, 1]) / np.sqrt(3):
            shape = np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]) / 4
            g = np.array([[-(1 - t), 1 - t, 1 + t, -(1 + t)], [-(1 - s), -(1 + s), 1 + s, 1 - s]]).T / 2 / h
            k += np.einsum("pj,ijkl,ql->piqk", g, c, g).reshape(8, 8) * h * h / 4
            m += np.kron(np.outer(shape, shape), np.eye(2)) * h * h / 4
    size = 2 * (n + 1) ** 2
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for i in range(n):
        for j in range(n):
            corner = [i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1]
            dof = np.array([[2 * p, 2 * p + 1] for p in corner]).ravel()
            stiffness[np.ix_(dof, dof)] += k
            mass[np.ix_(dof, dof)] += m
    return eigh(stiffness, mass, eigvals_only=True, subset_by_index=[3, 5])


if __name__ == "__main__":
    x, volume = cloud()
    with open("cloud.csv", "w") as out:
        out.write("x,y,volume\n")
        for (a, b), v in zip(x, volume):
            out.write(f"{a:.6f},{b:.6f},{v:.6f}\n")
    c = stiffness_tensor(1.0, 0.25, 2)
    print("local:", local(24, c), local(32, c))
    ratio = float(sys.argv[1]) if len(sys.argv) > 1 else 1e-2
    for horizon in (2.1, 3.1):
        near = families(x, horizon)
        print(f"horizon {horizon}: families of {min(map(len, near))} to {max(map(len, near))}")
        for name, split, wan in (
            ("conventional", full, False),
            ("Wan", full, True),
            ("quadrants", orthants, False),
            ("3 sectors", sectors(3), False),
            ("4 sectors", sectors(4), False),
            ("6 sectors", sectors(6), False),
        ):
            rows, dropped, whole = gradients(x, volume, near, split, ratio)
            k = assemble(x, volume, rows, c, wan).toarray()
            scale = np.sqrt(np.repeat(volume, 2))
            values = eigh(k / np.outer(scale, scale), eigvals_only=True)
            print(f"  {name}: eigenvalues 4, 5, 6: {values[3]:.6e} {values[4]:.6e} {values[5]:.6e}, largest {values[-1]:.4f}; dropped {dropped}, full family {whole}")
