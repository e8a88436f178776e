"""Snap-through of a shallow clamped arch under a uniform load, in series: reference of deck.yaml.

Shallow arch of depth h, span L, rise H, y0 = H/2 (1 - cos 2 pi x/L), unit thickness; y = sum a_k (1 - cos k_k x), k_k = 2 pi k/L. The axial force N is the same everywhere, and with shear (a clamped end
has no rotation, which the sine series of the rotations fulfils)

    S_k (a_k - a0_k) + N L/2 k_k^2 a_k + p L = 0,    S_k = L/2 EI k_k^4/(1 + EI k_k^2/(kappa G A)),    N/(EA) = sum k_k^2/4 (a_k^2 - a0_k^2).

For a given N the last is quadratic in p: the path is drawn by N, without iteration. Also writes points.csv, the lattice bent to the arch.

    python reference.py
"""
from math import pi, sqrt

E, NU = 1.0, 0.3
NX, NY, RISE = 240, 6, 1.6  # points along and across; rise over depth
CLAMPED = 4  # columns held at each end, beyond the span
L, DEPTH = float(NX), float(NY)
H = RISE * DEPTH
MODES = 60


def inertia_of_quadrants():
    """Sum over the points of the square of the height at which they take their strain: a quadrant of nearest neighbours sees the mean of two rows, and the outer rows have quadrants on one side only."""
    heights = [j - (NY - 2) / 2 for j in range(NY - 1)]  # between the rows
    rows = [heights[max(j - 1, 0) : j + 1] for j in range(NY)]
    return sum(sum(h * h for h in row) / len(row) for row in rows)


def path(inertia):
    area = DEPTH
    shear = 5 / 6 * E / (2 * (1 + NU)) * area
    k = [2 * pi * q / L for q in range(1, MODES + 1)]
    stiff = [L / 2 * E * inertia * q**4 / (1 + E * inertia * q**2 / shear) for q in k]
    first = [H / 2] + [0.0] * (MODES - 1)
    points = []
    critical = [s / (L / 2 * q * q) for s, q in zip(stiff, k)]
    # the force passes the critical one of the first symmetric mode, where the denominators change their sign, and stays below that of the second
    count = 20000
    for i in range(1, count):
        n = -0.99 * critical[1] * (i - 0.3) / count
        d = [s + n * L / 2 * q * q for s, q in zip(stiff, k)]
        # a_k = (s a0 - p L)/d
        a2 = sum(q * q / 4 * (L / e) ** 2 for q, e in zip(k, d))
        a1 = sum(-2 * q * q / 4 * s * f * L / e**2 for q, e, s, f in zip(k, d, stiff, first))
        a0 = sum(q * q / 4 * ((s * f / e) ** 2 - f * f) for q, e, s, f in zip(k, d, stiff, first)) - n / (E * area)
        root = a1 * a1 - 4 * a2 * a0
        if root < 0:
            continue
        for sign in (-1, 1):
            p = (-a1 + sign * sqrt(root)) / (2 * a2)
            a = [(s * f - p * L) / e for s, f, e in zip(stiff, first, d)]
            middle = sum(2 * q for q, m in zip(a, range(1, MODES + 1)) if m % 2 == 1)
            points.append((H - middle, p, -n / critical[0]))
    points.sort()
    return points


def limits(name, inertia):
    points = path(inertia)
    print(f"{name}: I = {inertia}, of a rectangle {DEPTH**3 / 12}")
    below = [q for q in points if q[0] < H]
    upper = max(below, key=lambda q: q[1])
    lower = min((q for q in points if q[0] > upper[0]), key=lambda q: q[1])
    print(f"{len(points)} states; upper limit load {upper[1]!r} at deflection {upper[0] / DEPTH:.4f} depths, axial force over that of the first symmetric mode {upper[2]:.3f} (antisymmetric: 2.05)")
    print(f"lower limit load {lower[1]!r} at deflection {lower[0] / DEPTH:.4f} depths")
    for share in (0.25, 0.5, 0.75):
        p = share * upper[1]
        found = min((q for q in points if q[0] < upper[0]), key=lambda q: abs(q[1] - p))
        print(f"deflection of the middle at {share} of it: {found[0]!r}")


def main():
    limits("continuum", DEPTH**3 / 12)
    limits("quadrants of nearest neighbours", inertia_of_quadrants())
    with open("points.csv", "w") as out:
        out.write("x,y,volume\n")
        from math import cos
        for j in range(NY):
            for i in range(-CLAMPED, NX + CLAMPED):
                x = i + 0.5
                y0 = H / 2 * (1 - cos(2 * pi * x / L)) if 0 <= x <= L else 0.0
                out.write(f"{x},{y0 + j + 0.5 - NY / 2:.12f},1\n")


if __name__ == "__main__":
    main()
