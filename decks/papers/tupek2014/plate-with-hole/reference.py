"""The linear equations of extended correspondence for the plate, assembled and solved with numpy alone, and its reactions."""
import numpy as np

E, NU, PULL = 200e9, 0.25, 1e-8


def reaction(q, m, g):
    """Force on the right row of points, plane strain, constant influence, zero-energy control of strength g."""
    dx = 1 / q
    cells = [(i, j) for i in range(-q // 2, q // 2) for j in range(-q // 4, q // 4) if abs(2 * i + 1) + abs(2 * j + 1) >= q // 4 + 1]
    x = (np.array(cells) + 0.5) * dx
    number = {c: k for k, c in enumerate(cells)}
    far = m * np.sqrt(2)
    n = int(far)
    offsets = [(a, b) for a in range(-n, n + 1) for b in range(-n, n + 1) if 0 < a * a + b * b <= far * far]
    lam, mu = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
    c = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, 2 * mu]])
    stiffness = np.zeros((2 * len(x), 2 * len(x)))
    v = dx * dx
    for k, (i, j) in enumerate(cells):
        family = [(number[i + a, j + b], a, b) for a, b in offsets if (i + a, j + b) in number]
        xi = np.array([(a, b) for _, a, b in family], float) * dx
        r = np.sqrt((xi**2).sum(1))
        unit = xi / r[:, None]
        square = np.stack([unit[:, 0]**2, unit[:, 1]**2, np.sqrt(2) * unit[:, 0] * unit[:, 1]], 1)
        # stretches of the bonds from the displacements of this point and of its neighbours
        dofs = [2 * k, 2 * k + 1] + [d for p, _, _ in family for d in (2 * p, 2 * p + 1)]
        stretch = np.zeros((len(family), len(dofs)))
        stretch[:, :2] = -unit / r[:, None]
        for row in range(len(family)):
            stretch[row, 2 + 2 * row:4 + 2 * row] = unit[row] / r[row]
        strain = np.linalg.solve(v * square.T @ square, v * square.T @ stretch)
        rest = stretch - square @ strain
        s = g * 8 * mu / (v * len(family))
        stiffness[np.ix_(dofs, dofs)] += v * (strain.T @ c @ strain + s * v * rest.T @ rest)
    u = np.zeros(2 * len(x))
    left, right = np.flatnonzero(x[:, 0] < x[:, 0].min() + dx / 2), np.flatnonzero(x[:, 0] > x[:, 0].max() - dx / 2)
    u[2 * left], u[2 * right] = -PULL, PULL
    held = np.concatenate([2 * left, 2 * right, [2 * number[-q // 2, 0] + 1]])
    free = np.setdiff1d(np.arange(2 * len(x)), held)
    u[free] = np.linalg.solve(stiffness[np.ix_(free, free)], -(stiffness[free] @ u))
    return (stiffness @ u)[2 * right].sum()


if __name__ == '__main__':
    for m, g in [(1.1, 1), (3.1, 1), (3.1, 0)]:
        print(f"q = 40, horizon {m} diagonals, control {g}: {reaction(40, m, g):.9g} N")
