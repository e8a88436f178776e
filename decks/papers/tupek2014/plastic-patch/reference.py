"""One material point by itself: J2 return mapping in three dimensions (plane stress by bisection of the strain across), and Hooke's law of a turned
orthotropic solid. Prints the stresses that deck.yaml and orthotropic.yaml expect. numpy only."""
import numpy as np


def j2(strain, plastic, p, E, nu, Y, H):
    """Small-strain radial return (Simo & Hughes, box 3.2): stress, new plastic strain, new equivalent plastic strain."""
    G, K = E / 2 / (1 + nu), E / 3 / (1 - 2 * nu)
    e = strain - plastic
    dev = 2 * G * (e - np.trace(e) / 3 * np.eye(3))
    q = np.sqrt(1.5 * np.sum(dev * dev))
    if q > Y + H * p:
        step = (q - Y - H * p) / (3 * G + H)
        plastic = plastic + 1.5 * step * dev / q
        dev = dev * (1 - 3 * G * step / q)
        p = p + step
    return dev + K * np.trace(e) * np.eye(3), plastic, p


def path(r, levels, stress_free, E, nu, Y, H, steps):
    """Green-Lagrange strains (a, r a) along x and y, a through the levels; Cauchy stress (J of the plane) and its equivalent at each level."""
    plastic, p, out, last = np.zeros((3, 3)), 0.0, [], 0.0
    for level in levels:
        for k in range(1, steps + 1):
            a = last + (level - last) * k / steps
            strain = np.diag([a, r * a, 0.0])
            if stress_free:
                lo, hi = -1.0, 1.0
                for _ in range(200):
                    strain[2, 2] = 0.5 * (lo + hi)
                    if j2(strain, plastic, p, E, nu, Y, H)[0][2, 2] > 0:
                        hi = strain[2, 2]
                    else:
                        lo = strain[2, 2]
            stress, plastic, p = j2(strain, plastic, p, E, nu, Y, H)
        last = level
        stretch = np.sqrt(1 + 2 * np.array([level, r * level]))
        f = np.diag([*stretch, 1.0])
        sigma = f @ stress @ f.T / stretch.prod()
        dev = sigma - np.trace(sigma) / 3 * np.eye(3)
        out.append((sigma[0, 0], sigma[1, 1], sigma[2, 2], np.sqrt(1.5 * np.sum(dev * dev))))
    return out


def orthotropic(angle, plane_stress, strain):
    """Stress of a lamina (axes turned by an angle about z) under a strain in the plane."""
    e, g, n = (140e9, 10e9, 9e9), (3e9, 5e9, 6e9), (0.4, 0.3, 0.25)  # E1 E2 E3; G23 G13 G12; nu23 nu13 nu12
    s = np.zeros((6, 6))
    s[:3, :3] = [[1 / e[0], -n[2] / e[0], -n[1] / e[0]], [-n[2] / e[0], 1 / e[1], -n[0] / e[1]], [-n[1] / e[0], -n[0] / e[1], 1 / e[2]]]
    for k in range(3):
        s[3 + k, 3 + k] = 1 / g[k]
    c = np.linalg.inv(s)
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    t = np.zeros((3, 3, 3, 3))
    for i, (a, b) in enumerate(pairs):
        for j, (k, l) in enumerate(pairs):
            for x in {(a, b), (b, a)}:
                for y in {(k, l), (l, k)}:
                    t[x + y] = c[i, j]
    w = np.radians(angle)
    r = np.array([[np.cos(w), -np.sin(w), 0], [np.sin(w), np.cos(w), 0], [0, 0, 1]])
    t = np.einsum("ia,jb,kc,ld,abcd", r, r, r, r, t)
    full = np.zeros((3, 3))
    full[:2, :2] = strain
    if plane_stress:
        # no stress across: condense the strains 33, 13, 23
        free = [(2, 2), (0, 2), (1, 2)]
        def stress_of(x):
            full[2, 2], full[0, 2], full[2, 0], full[1, 2], full[2, 1] = x[0], x[1], x[1], x[2], x[2]
            return np.einsum("ijkl,kl", t, full)
        base = stress_of([0, 0, 0])
        m = np.array([[stress_of(np.eye(3)[j])[f] - base[f] for j in range(3)] for f in free])
        return stress_of(np.linalg.solve(m, [-base[f] for f in free]))
    return np.einsum("ijkl,kl", t, full)


if __name__ == "__main__":
    steel = dict(E=200e9, nu=0.3, Y=400e6, H=20e9)
    levels = [0.01, 0.0085, -0.006]
    for name, r, free, scale in [("plane-strain", -0.3, False, 1), ("plane-stress", 0.4, True, 1), ("small", -0.3, False, 1e-4)]:
        own = dict(steel, Y=steel["Y"] * scale)
        for load, row in enumerate(path(r, [scale * a for a in levels], free, steps=6, **own), 1):
            print(name, load, *(f"{x:.10e}" for x in row))
        if free:
            for steps in (6, 24, 96, 400):
                row = path(r, [scale * a for a in levels], free, steps=steps, **own)
                print("  steps", steps, *(f"{x:.10e}" for x in row[2]))
    f = np.array([[1.02, 0.01], [-0.015, 0.99]])
    strain = (f.T @ f - np.eye(2)) / 2
    for name, free in [("plane-strain", False), ("plane-stress", True)]:
        s = orthotropic(30, free, strain)
        j = np.linalg.det(f)
        full = np.eye(3)
        full[:2, :2] = f
        sigma = full @ s @ full.T / j
        print("orthotropic", name, f"{0.5 * np.sum(s[:2, :2] * strain):.10e}", *(f"{sigma[i, k]:.10e}" for i, k in [(0, 0), (0, 1), (1, 1), (2, 2)]))
