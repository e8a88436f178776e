"""Why a crack in a lattice of bonds takes up more than the energy of the bonds it breaks, and how much.

A bond of stiffness k that breaks between two points of compliance c (the bond included) takes the energy w/(1 - k c) out of a body whose supports stand still, w = k e^2/2 being
what it held: its own energy, and that of the others as they move to the new equilibrium. The sum of k c over all bonds is the number of free displacement components
(the trace of a projection), so that no lattice has k c = 0.

The double cantilever of deck.yaml is made here with numpy alone, in the plane or as a slice of a solid (bonds in space, nothing moves or changes along z: plane strain; bonds that
differ in z alone break together). The bonds across the plane of the crack are broken one after the other and both energies are added up: as the wedge opens without ever going back (`load`), and with
the wedge at each bond's threshold (`breaking`).

    python trapping.py            # some minutes
"""
import sys

import numpy as np


def body(m, nx, ny, solid):
    """Bonds of a lattice of spacing 1, E = 1: ends, lengths, directions in the plane, stiffnesses, and how many bonds of a solid each stands for."""
    x = np.array([(i + 0.5, j + 0.5 - ny / 2) for j in range(ny) for i in range(nx)])
    r = int(m)
    offsets = [(i, j, k) for k in (range(-r, r + 1) if solid else [0]) for j in range(-r, r + 1) for i in range(-r, r + 1)]
    offsets = [o for o in offsets if 0 < sum(q * q for q in o) <= m * m * (1 + 1e-9)]
    moment = np.zeros(nx * ny)
    inside = lambda i, j: 0 <= i < nx and 0 <= j < ny
    for j in range(ny):
        for i in range(nx):
            moment[j * nx + i] = sum(np.sqrt(a * a + b * b + c * c) for a, b, c in offsets if inside(i + a, j + b))
    c = (12 if solid else 6) / moment  # micromodulus, each from its own family: 18 k, 6 E
    a, b, length, direction, many = [], [], [], [], []
    for j in range(ny):
        for i in range(nx):
            for di, dj, dk in offsets:
                if dk >= 0 and (dj > 0 or dj == 0 and di > 0) and inside(i + di, j + dj):
                    l = np.sqrt(di * di + dj * dj + dk * dk)
                    a.append(j * nx + i)
                    b.append((j + dj) * nx + i + di)
                    length.append(l)
                    direction.append((di / l, dj / l))
                    many.append(2 if dk > 0 else 1)
    a, b, length, direction, many = (np.array(q) for q in (a, b, length, direction, many))
    return x, a, b, length, direction, 0.5 * (c[a] + c[b]) / length * many


def main(m, nx, ny, start, end, solid, following):
    x, a, b, length, direction, k = body(m, nx, ny, solid)
    n = len(x)
    xi = x[b] - x[a]
    dofs = np.stack([2 * a, 2 * a + 1, 2 * b, 2 * b + 1], 1)
    row = np.concatenate([-direction, direction], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x[a, 0] - x[a, 1] / xi[:, 1] * xi[:, 0]
    crossing = x[a, 1] * x[b, 1] < 0
    alive = ~(crossing & (at <= start))
    stiffness = np.zeros((2 * n, 2 * n))
    for i in range(4):
        for j in range(4):
            np.add.at(stiffness, (dofs[alive, i], dofs[alive, j]), k[alive] * row[alive, i] * row[alive, j])
    up, low = (x[:, 0] < 2) & (x[:, 1] > 3), (x[:, 0] < 2) & (x[:, 1] < -3)
    fixed, unit = np.zeros(2 * n, bool), np.zeros(2 * n)
    for points, value in ((up, 1.0), (low, -1.0)):
        fixed[2 * np.where(points)[0] + 1] = True
        unit[2 * np.where(points)[0] + 1] = value
    fixed[2 * np.argmin(np.hypot(x[:, 0] - nx + 0.5, x[:, 1] - 0.5))] = True
    free = np.where(~fixed)[0]
    compliance = np.zeros((2 * n, 2 * n))
    compliance[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
    u = unit - compliance @ (stiffness @ unit)
    u[fixed] = unit[fixed]
    kc = k * np.einsum("bi,bij,bj->b", row, compliance[dofs[:, :, None], dofs[:, None, :]], row)
    trace = f"sum of k c {np.sum(kc[alive]):.6f}, free components {len(free)}"
    # bonds of the middle, and what a straight crack breaks per spacing: s0 = 1 makes G_c of it
    middle = crossing & (at > start + 5) & (at <= start + 9)
    per_spacing = np.sum(middle) / 4
    g_c = 0.5 * np.sum(k[middle] * length[middle] ** 2) / 4
    stored = released = load = 0.0
    broken, each, history = 0, [], []
    across = np.where(crossing)[0]
    while True:
        e = np.einsum("bi,bi->b", row[across], u[dofs[across]])
        s = np.where(alive[across], e / length[across], -1.0)
        q = np.argmax(s)
        worst = across[q]
        if s[q] <= 0 or at[worst] > end:
            break
        load = 1 / s[q] if following else max(load, 1 / s[q])
        g = row[worst]
        column = compliance[:, dofs[worst]] @ g
        own = k[worst] * g @ column[dofs[worst]]
        w = 0.5 * k[worst] * (load * e[q]) ** 2
        stored, released = stored + w, released + w / (1 - own)
        each.append(own)
        broken += 1
        history.append((broken, stored, released))
        # Sherman and Morrison
        compliance += k[worst] / (1 - own) * np.outer(column, column)
        u += k[worst] * e[q] / (1 - own) * column
        alive[worst] = False
    history = np.array(history)
    # steady growth: leave the first three spacings out
    begin = int(3 * per_spacing)
    span = history[-1] - history[begin]
    area = span[0] / per_spacing
    print(
        f"{'solid' if solid else 'plane'}, ratio {m}, {nx} x {ny}, {'breaking' if following else 'load'}: {trace}; {broken} broken, {per_spacing:.0f} a spacing; k c of those"
        f" {np.mean(each[begin:]):.4f} ({min(each[begin:]):.3f} to {max(each[begin:]):.3f}); over G_c times the area: held {span[1] / g_c / area:.4f}, taken out {span[2] / g_c / area:.4f}",
        flush=True,
    )


CASES = [
    (3.015, 40, 16, 10, 24, False),
    (4.015, 40, 16, 10, 24, False),
    (5.015, 44, 18, 11, 25, False),
    (6.015, 48, 20, 12, 26, False),
    (8.015, 52, 24, 13, 26, False),
    (3.015, 40, 16, 10, 24, True),
    (4.015, 40, 16, 10, 24, True),
    (5.015, 44, 18, 11, 23, True),
]

if __name__ == "__main__":
    chosen = [CASES[int(q)] for q in sys.argv[1:]] or CASES
    for case in chosen:
        for following in (False, True):
            main(*case, following)
