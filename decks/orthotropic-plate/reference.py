"""Independent reference of the plate: turned stiffness, and linear correspondence statics assembled from B-operators.

With numpy: python reference.py. It prints the numbers that plate.yaml holds.
"""
import itertools

import numpy as np

CONSTANTS = dict(e1=140e9, e2=10e9, e3=12e9, g12=5e9, g13=6e9, g23=3.5e9, nu12=0.3, nu13=0.28, nu23=0.45)
VOIGT = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]


def stiffness(e1, e2, e3, g12, g13, g23, nu12, nu13, nu23):
    s = np.diag([1 / e1, 1 / e2, 1 / e3, 1 / g23, 1 / g13, 1 / g12])
    s[0, 1] = s[1, 0] = -nu12 / e1
    s[0, 2] = s[2, 0] = -nu13 / e1
    s[1, 2] = s[2, 1] = -nu23 / e2
    v = np.linalg.inv(s)
    c = np.zeros((3, 3, 3, 3))
    for (a, (i, j)), (b, (k, l)) in itertools.product(enumerate(VOIGT), enumerate(VOIGT)):
        c[i, j, k, l] = c[j, i, k, l] = c[i, j, l, k] = c[j, i, l, k] = v[a, b]
    return c


def turned(c, degrees):
    a = np.radians(degrees)
    r = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    return np.einsum("ia,jb,kc,ld,abcd->ijkl", r, r, r, r, c)


def voigt(c):
    return np.array([[c[i, j, k, l] for k, l in VOIGT] for i, j in VOIGT])


def plane_stress(c):
    v = voigt(c)
    held, free = [0, 1, 5], [2, 3, 4]
    q = v[np.ix_(held, held)] - v[np.ix_(held, free)] @ np.linalg.solve(v[np.ix_(free, free)], v[np.ix_(free, held)])
    out = np.zeros((2, 2, 2, 2))
    pairs = [(0, 0), (1, 1), (0, 1)]
    for (a, (i, j)), (b, (k, l)) in itertools.product(enumerate(pairs), enumerate(pairs)):
        out[i, j, k, l] = out[j, i, k, l] = out[i, j, l, k] = out[j, i, l, k] = q[a, b]
    return out


def solve(x, dx, thickness, horizon, c, control, fixed):
    """Displacements, forces, and energy; `fixed` maps degrees of freedom to values."""
    n, v = len(x), dx * dx * thickness
    K = np.zeros((2 * n, 2 * n))
    for i in range(n):
        r = np.linalg.norm(x - x[i], axis=1)
        family = [j for j in range(n) if j != i and r[j] <= horizon * (1 + 1e-9)]
        xi = x[family] - x[i]
        inverse = np.linalg.inv(xi.T @ xi * v)
        g = xi @ inverse * v  # gradient rows of the family
        ids = family + [i]
        g = np.vstack([g, -g.sum(axis=0)])
        m = len(ids)
        grad = np.zeros((2, 2, 2 * m))  # H_ab of the displacements
        for a, b in itertools.product(range(2), range(2)):
            grad[a, b, a::2] = g[:, b]
        k = v * np.einsum("abp,abcd,cdq->pq", grad, c, grad)
        if control:
            c1 = np.einsum("abcd,cd->ab", c, inverse)
            for b in range(m - 1):
                z = -np.einsum("abp,b->ap", grad, xi[b])
                for a in range(2):
                    z[a, 2 * b + a] += 1
                    z[a, 2 * (m - 1) + a] -= 1
                k += v * v * z.T @ c1 @ z
        dofs = np.array([[2 * p, 2 * p + 1] for p in ids]).ravel()
        K[np.ix_(dofs, dofs)] += k
    u = np.zeros(2 * n)
    held = np.array(list(fixed))
    u[held] = list(fixed.values())
    free = np.setdiff1d(np.arange(2 * n), held)
    u[free] = np.linalg.solve(K[np.ix_(free, free)], -K[np.ix_(free, held)] @ u[held])
    return u.reshape(n, 2), (K @ u).reshape(n, 2), u @ K @ u / 2


if __name__ == "__main__":
    c = turned(stiffness(**CONSTANTS), 30)
    print("voigt, turned by 30 degrees:")
    for row in voigt(c):
        print("  [" + ", ".join(repr(float(0 if abs(value) < 1 else value)) for value in row) + "]")
    nx, ny, dx = 30, 12, 1e-3
    x = np.array([((i + 0.5) * dx, (j + 0.5) * dx) for j in range(ny) for i in range(nx)])
    index = lambda i, j: j * nx + i
    fixed = {}
    for j in range(ny):
        fixed |= {2 * index(0, j): 0, 2 * index(0, j) + 1: 0, 2 * index(nx - 1, j): 1e-6}
    u, f, energy = solve(x, dx, 1e-3, 3.015 * dx, plane_stress(c), True, fixed)
    print("reaction", repr(sum(f[index(nx - 1, j), 0] for j in range(ny))))
    print("energy", repr(energy))
    for i, j in [(29, 11), (15, 0), (10, 8)]:
        print("u at", i, j, [repr(float(value)) for value in u[index(i, j)]])
