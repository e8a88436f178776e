"""Sums over lattice families for the decks of this folder, with numpy alone.

python reference.py prints the numbers that stand in the decks as `parameters` or expected values.
"""
import itertools
import numpy as np


def lattice(d, n, limit=None):
    """Bonds of a family of horizon ratio n, in spacings."""
    x = np.array([p for p in itertools.product(range(-n, n + 1), repeat=d) if 0 < sum(c * c for c in p) <= n * n], float)
    return x


def collapse(d, n, inner2):
    """Shares of a family within the square of the radius inner2: of bonds, of their squares, and the gradient that parts see."""
    x = lattice(d, n)
    r2 = (x**2).sum(1)
    inside = r2 < inner2
    count = inside.sum() / len(x)
    square = r2[inside].sum() / r2.sum()
    closed = (x >= 0).all(1)
    k = lambda s: np.einsum('ni,nj->ij', x[s], x[s])
    part = k(closed & inside) @ np.linalg.inv(k(closed))
    h = 0.5 * (part + part.T)
    print(f"collapse {d}D n={n}: bonds {count:.12f} squares {square:.12f} parts (rms of the components) {np.sqrt((h * h).sum() / d):.12f}"
          f"  continuum {np.sqrt(inner2) / n:.4f}^d = {(np.sqrt(inner2) / n)**d:.5f}, ^(d+2) = {(np.sqrt(inner2) / n)**(d + 2):.5f}")


def mandel(d):
    pairs = [(i, i) for i in range(d)] + [(i, j) for i in range(d) for j in range(i + 1, d)]
    return pairs, np.array([1.0 if i == j else np.sqrt(2) for i, j in pairs])


def operator(x, d):
    """Map of small uniform strains to the nonlocal strain as published, with a constant influence, in the components of Mandel."""
    w = d / len(x)
    n = x / np.sqrt((x**2).sum(1))[:, None]
    pairs, s = mandel(d)
    square = np.stack([n[:, i] * n[:, j] * f for (i, j), f in zip(pairs, s)], 1)
    one = np.array([1.0 if i == j else 0.0 for i, j in pairs])
    h = (d + 2) / 2 * square - 0.5 * one
    return w * h.T @ square


def vector(f, d):
    """Green-Lagrange strain of F in the components of Mandel."""
    e = 0.5 * (f.T @ f - np.eye(d))
    pairs, s = mandel(d)
    return np.array([e[i, j] * c for (i, j), c in zip(pairs, s)])


STRETCH = {2: np.array([[1.03, 0.05], [0.02, 0.96]]), 3: np.array([[1.03, 0.05, -0.02], [0.02, 0.96, 0.04], [0.01, -0.03, 1.02]])}


def uniform(d, n):
    x = lattice(d, n)
    for name, part in [('interior', x), ('face', x[x[:, 0] >= 0]), ('corner', x[(x >= 0).all(1)])]:
        m = operator(part, d)
        error = np.linalg.norm(m - np.eye(len(m)), 2)
        deviator = np.zeros(len(m)); deviator[:2] = [1, -1]
        shear = np.zeros(len(m)); shear[d] = 1
        one = np.array([1.0] * d + [0.0] * (len(m) - d))
        e = m @ vector(STRETCH[d], d)
        print(f"uniform {d}D n={n} {name}: error {100 * error:.3f} %  deviator {np.linalg.norm(m @ deviator) / 2**.5:.6f}"
              f"  shear {np.linalg.norm(m @ shear):.6f}  W of F {0.5 * e @ e:.15e}  dilatation {np.linalg.norm(m @ one) / d**.5:.12f}")


def jump():
    """m = -1/4, jump -0.3 seen from -0.1: -[int sqrt(t/|t - 0.3|) - 1] over (0.1, 1), by substitution t = 0.3 +- s^2."""
    g, w = np.polynomial.legendre.leggauss(200)
    def integral(f, a, b):
        return (b - a) / 2 * (w * f((b - a) / 2 * g + (a + b) / 2)).sum()
    left = integral(lambda s: 2 * np.sqrt(0.3 - s * s), 0, np.sqrt(0.2))
    right = integral(lambda s: 2 * np.sqrt(0.3 + s * s), 0, np.sqrt(0.7))
    print(f"jump, m = -1/4: {-(left + right - 0.9):.12f}")
    h = lambda u: u * np.log(u) - u
    print(f"jump, m = 0: {0.5 * (h(0.2) + h(0.7) - h(1) + h(0.1)):.12f}")


def sine(n, phase):
    """Second-order strain of a sine wave over (2m - 1)/2 a^2: the mean square of the stretch, weighted by omega xi^2."""
    j = np.concatenate([np.arange(-n, 0), np.arange(1, n + 1)])
    for name, omega in [('inverse length', lambda r: 1 / r), ('cone', lambda r: 1 - r)]:
        w = omega(abs(j) / n) * (j / n)**2
        w = w / w.sum()
        for k in [1, 2, 7]:
            stretch = (np.sin(2 * np.pi * k * j / n + phase) - np.sin(phase)) / (j / n)
            print(f"sine, {name}, k={k}: first order {w @ stretch:.1e}, mean square {w @ stretch**2:.9f}")


def checkerboard(d, n):
    """Bonds that a wave of two spacings stretches: the sum of 1/r^2 over the size of the family, and its tensor, diagonal along the rows."""
    x = lattice(d, n)
    r2 = (x**2).sum(1)
    for k in range(1, d + 1):
        odd = x[:, :k].sum(1) % 2 == 1
        tensor = [(x[odd, a]**2 / r2[odd]**2).sum() / len(x) for a in range(d)]
        print(f"checkerboard {d}D n={n} along {k} axes: sum {(1 / r2[odd]).sum() / len(x):.12f}, tensor {tensor}")


if __name__ == '__main__':
    collapse(2, 10, 30.25)
    collapse(3, 6, 9.5)
    for d in [2, 3]:
        for n in [3, 4]:
            uniform(d, n)
    jump()
    sine(40, 0.4)
    for d in [1, 2, 3]:
        checkerboard(d, 3)
