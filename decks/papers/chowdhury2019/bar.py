"""One-dimensional correspondence bars on a lattice: conventional, corrected influence function, sub-horizons.

A reference for the decks of this folder that shares nothing with the program: gradients are rows of integers and
rationals, the stiffness is assembled as a banded matrix and factorised.

Rules (they are not all in the paper): n cell centres (i + 1/2) dx, neighbours |j - i| dx <= delta (closed ball), influence 1;
strain of a set of bonds H at point i: sum_H xi (u_j - u_i) / sum_H xi^2; the Young's modulus is that of the point.
"""
from fractions import Fraction

import numpy as np
from scipy.linalg import solveh_banded

ZERO_ENERGY, RENORMALISE = "zero_energy", "renormalise"


def reach(ratio):
    """Number of neighbours on each side for delta = ratio dx."""
    return int(np.floor(ratio * (1 + 1e-9)))


def sub_horizons(ratio, count):
    """Offsets of `count` equal intervals of [-delta, delta]; edges belong to both neighbours, 0 to none."""
    m = reach(ratio)
    edges = [ratio * (2 * a / count - 1) for a in range(count + 1)]
    eps = 1e-9 * ratio
    return [[k for k in range(-m, m + 1) if k and low - eps <= k <= high + eps] for low, high in zip(edges, edges[1:])]


def correction(offsets, ratio, order):
    """C(s) = sum c_n s^n at the offsets, s = k / ratio, from the moments of these offsets; exact rationals."""
    order = min(order, len(offsets))
    r = Fraction(str(ratio))
    s = [Fraction(k) / r for k in offsets]
    moment = [sum(x**n for x in s) for n in range(2 * order + 1)]
    a = [[moment[i + j + 2] for j in range(order)] + [moment[2] if i == 0 else Fraction(0)] for i in range(order)]
    for p in range(order):
        q = next(q for q in range(p, order) if a[q][p] != 0)
        a[p], a[q] = a[q], a[p]
        a[p] = [v / a[p][p] for v in a[p]]
        for q in range(order):
            if q != p and a[q][p] != 0:
                a[q] = [v - a[q][p] * w for v, w in zip(a[q], a[p])]
    c = [row[-1] for row in a]
    return [sum(ci * x**n for n, ci in enumerate(c)) for x in s]


class Bar:
    """A bar of n points and length 1; `count` sub-horizons (1: the full family) or a corrected `order` of the full family."""

    def __init__(self, n, ratio, count=1, rule=ZERO_ENERGY, order=1):
        self.n, self.dx, self.m = n, 1.0 / n, reach(ratio)
        m = self.m
        # rows[i]: list of (weight 1/N_SH, offsets, coefficients of u_j - u_i, per dx)
        self.sets = sub_horizons(ratio, count) if count > 1 else [[k for k in range(-m, m + 1) if k]]
        table = {}
        self.rows = []
        for i in range(n):
            key = (min(i, m), min(n - 1 - i, m))
            if key not in table:
                table[key] = self._gradients(*key, ratio, rule, order)
            self.rows.append(table[key])

    def _gradients(self, left, right, ratio, rule, order):
        kept = [[k for k in offsets if -left <= k <= right] for offsets in self.sets]
        full = [offsets for offsets in kept if offsets]
        number = len(full) if rule == RENORMALISE else len(self.sets)
        result = []
        for offsets in full:
            c = correction(offsets, ratio, order) if order > 1 else [Fraction(1)] * len(offsets)
            shape = sum(Fraction(k) ** 2 for k in offsets)
            result.append((1.0 / number, np.array(offsets), np.array([float(ci * k / shape) for ci, k in zip(c, offsets)])))
        return result

    def strains(self, u):
        """The mean of the strains of the sub-horizons at each point."""
        e = np.empty(self.n)
        for i, row in enumerate(self.rows):
            values = [np.dot(g, u[i + k] - u[i]) / self.dx for _, k, g in row]
            e[i] = np.mean(values)
        return e

    def stiffness(self, modulus):
        """Lower banded stiffness per cross section, K[d, j] = K_(j+d, j)."""
        band = np.zeros((2 * self.m + 1, self.n))
        groups = {}
        for i, row in enumerate(self.rows):
            groups.setdefault(id(row), (row, []))[1].append(i)
        for row, points in groups.values():
            points = np.array(points)
            for weight, k, g in row:
                offsets = np.append(k, 0)
                coefficient = np.append(g, -g.sum()) / self.dx
                for a, ga in zip(offsets, coefficient):
                    for b, gb in zip(offsets, coefficient):
                        if a >= b:
                            np.add.at(band, (a - b, points + b), weight * self.dx * modulus[points] * ga * gb)
        return band

    def energy_measure(self, u, modulus):
        """Sum of u_i f_i, f the internal force density times -1: twice the strain energy divided by dx."""
        total = 0.0
        groups = {}
        for i, row in enumerate(self.rows):
            groups.setdefault(id(row), (row, []))[1].append(i)
        for row, points in groups.values():
            points = np.array(points)
            for weight, k, g in row:
                strain = (u[points[:, None] + k] - u[points][:, None]) @ g / self.dx
                total += weight * np.sum(modulus[points] * strain**2)
        return total

    def pull(self, modulus, traction):
        """Displacements with the first point held and the traction on the last point; refined once in long double."""
        band = self.stiffness(modulus)[:, 1:]
        f = np.zeros(self.n - 1)
        f[-1] = traction
        u = solveh_banded(band, f, lower=True)
        exact = band.astype(np.longdouble)
        for _ in range(2):
            v = u.astype(np.longdouble)
            r = f.astype(np.longdouble) - exact[0] * v
            for d in range(1, band.shape[0]):
                r[d:] -= exact[d, :-d] * v[:-d]
                r[:-d] -= exact[d, :-d] * v[d:]
            u = np.asarray(v + solveh_banded(band, np.asarray(r, float), lower=True), float)
        return np.concatenate([[0.0], u])


E0, ALPHA, TRACTION = 1e7, 1e-3, 1e4


def positions(n):
    return (np.arange(n) + 0.5) / n


def modulus(x):
    """Young's modulus of the paper's bar, eq. (42)."""
    soft = ALPHA / (ALPHA + 0.01 / (2 * np.sqrt(np.maximum(x - 0.5, 1e-300))))
    return E0 * np.where(x > 0.5, soft, 1.0)


def local(x):
    """Its displacement in local elasticity."""
    return TRACTION / E0 * (x + np.where(x > 0.5, 0.01 / ALPHA * np.sqrt(np.maximum(x - 0.5, 0)), 0))


def singular_bar(n, ratio, **kinematics):
    x = positions(n)
    return x, Bar(n, ratio, **kinematics).pull(modulus(x), TRACTION)


def at(x, u, place):
    return np.interp(place, x, u)


def distance(x, u):
    """Root mean square distance to the local solution, relative."""
    return np.sqrt(np.sum((u - local(x)) ** 2) / np.sum(local(x) ** 2))


def roughness(x, u):
    """Largest second difference for 0.05 < x < 0.45 over (t/E0) dx."""
    inside = (x[1:-1] > 0.05) & (x[1:-1] < 0.45)
    return np.abs(u[2:] - 2 * u[1:-1] + u[:-2])[inside].max() / (TRACTION / E0 * (x[1] - x[0]))


def zigzag(x, u):
    """Total variation of the difference quotients over that of the local solution."""
    variation = lambda v: np.abs(np.diff(v, 2)).sum()
    return variation(u) / variation(local(x))


def corrected_in_fifty_digits(order, n=4000, ratio=5.1):
    """The displacement of the last point of the singular bar, corrected influence function: high orders lose half of the digits of doubles."""
    from mpmath import mp, mpf, sqrt

    mp.dps = 50
    m, dx = reach(ratio), mpf(1) / n
    width, e0 = 2 * m, mpf(10) ** 7
    gradients, band = {}, [[mpf(0)] * (2 * m + 1) for _ in range(n)]
    for i in range(n):
        ends = (min(i, m), min(n - 1 - i, m))
        if ends not in gradients:
            offsets = [k for k in range(-ends[0], ends[1] + 1) if k]
            shape = sum(Fraction(k) ** 2 for k in offsets)
            rational = [c * k / shape for c, k in zip(correction(offsets, ratio, order), offsets)]
            g = [mpf(q.numerator) / q.denominator / dx for q in rational]
            gradients[ends] = list(zip(offsets + [0], g + [-sum(g)]))
        x = (i + mpf(1) / 2) * dx
        e = e0 if 2 * x <= 1 else e0 / (1 + 5 / sqrt(x - mpf(1) / 2))
        for a, ga in gradients[ends]:
            for b, gb in gradients[ends]:
                if a >= b:
                    band[i + b][a - b] += dx * e * ga * gb
    band, n = band[1:], n - 1
    u = [mpf(0)] * (n - 1) + [mpf(10) ** 4]
    for j in range(n):
        below = min(width, n - 1 - j)
        for p in range(1, below + 1):
            factor = band[j][p] / band[j][0]
            for q in range(p, below + 1):
                band[j + p][q - p] -= factor * band[j][q]
            u[j + p] -= factor * u[j]
    # the last point needs no substitution backwards
    return u[-1] / band[-1][0]


def tables(refined=8000):
    print(f"local solution: u(L) = {local(np.array([1.0]))[0]:.16g} m")
    print("\nFig. 2, conventional, n = 4000 (ill-conditioned above 1.1: only the size means something)")
    for ratio in (1.1, 2.1, 4.1, 5.1, 10.1):
        x, u = singular_bar(4000, ratio)
        print(f"  {ratio:4} dx: u at the last point {u[-1]:.9e} m, zigzag {zigzag(x, u):.1e}, roughness {roughness(x, u):.1e}")
    print("\nFig. 3, corrected influence function, delta = 5.1 dx, order capped at the number of neighbours")
    for order in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10):
        x, u = singular_bar(4000, 5.1, order=order)
        exact = f" ({float(corrected_in_fifty_digits(order)):.12e} in 50 digits)" if order in (6, 7, 8, 10) else ""
        print(f"  N = {order:2}: u at the last point {u[-1]:.6e} m{exact}, roughness {roughness(x, u):.1e}")
    print("\nFigs. 4 and 5, sub-horizons, n = 4000: u at the last point, L2 distance to the local solution; with renormalisation")
    for count in (2, 4):
        for ratio in (1.1, 2.1, 4.1, 5.1, 10.1):
            if count == 4 and ratio < 4:
                continue
            x, u = singular_bar(4000, ratio, count=count)
            _, v = singular_bar(4000, ratio, count=count, rule=RENORMALISE)
            print(f"  {count} sub-horizons, {ratio:4} dx: {u[-1]:.9e} m, {distance(x, u):.3e}, roughness {roughness(x, u):.0e}; {v[-1]:.9e} m")
    x, two = singular_bar(4000, 10.1, count=2)
    x, four = singular_bar(4000, 10.1, count=4)
    print(f"  largest difference of two and four: {np.abs(two - four).max() / two.max():.4f} of the largest displacement at x = {x[np.argmax(abs(two - four))]:.4f}")
    near = np.abs(x - 0.5) < 10.1 / 4000
    print(f"  two, within a horizon of the jump: {np.sum(np.diff(two)[near[:-1]] < 0)} backward steps, smallest strain {np.diff(two)[near[:-1]].min() * 4000:.4f}")
    print("\nFig. 6, two sub-horizons: u(0.75) for delta = 0.01 L, and L2 distance to the local solution for delta = 1.1 dx, 10.1 dx")
    n, before = 500, None
    while n <= refined:
        x, u = singular_bar(n, 0.01 * n, count=2)
        errors = [distance(*singular_bar(n, ratio, count=2)) for ratio in (1.1, 10.1)]
        orders = "" if before is None else ", orders " + ", ".join(f"{np.log2(b / a):.4f}" for a, b in zip(errors, before))
        print(f"  n = {n:5}: {at(x, u, 0.75):.6e} m; {errors[0]:.4e}, {errors[1]:.4e}{orders}")
        n, before = 2 * n, errors
    print("\nFigs. 10 and 11: e(10), e(100), e(1000), L = 1, E = 1, a = 1, delta = L / 100, missing sub-horizons renormalised")
    for n in (1000, 2000, 4000):
        for count in (1, 2, 4):
            bar = Bar(n, n / 100, count=count, rule=RENORMALISE)
            e = [bar.energy_measure(np.sin(k * positions(n)), np.ones(n)) for k in (10, 100, 1000)]
            print(f"  n = {n}, {count} sub-horizons: " + ", ".join(f"{v:.5e}" for v in e))


if __name__ == "__main__":
    tables()
