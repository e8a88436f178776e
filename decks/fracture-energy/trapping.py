"""Why a crack in a lattice of bonds takes up more than the energy of the bonds it breaks.

A bond of stiffness k that breaks between two points of compliance c (the bond included) takes the energy w/(1 - k c) out of a body whose supports stand still, w = k e^2/2 being
what it held: its own energy, and that of the others as they move to the new equilibrium. The sum of k c over all bonds is the number of free displacement components
(the trace of a projection), so that no lattice has k c = 0.

The double cantilever of deck.yaml is made here with numpy alone, the bonds across the plane of the crack are broken one after the other as the wedge opens, and both energies are added up.

    python trapping.py            # horizon ratios 3.015 and 4.015; a minute
"""
import numpy as np

NX, NY, START = 40, 16, 10


def body(m):
    """Bonds of a square lattice of spacing 1, E = 1, plane stress, thickness 1: ends, lengths, directions, stiffnesses."""
    x = np.array([(i + 0.5, j + 0.5 - NY / 2) for j in range(NY) for i in range(NX)])
    a, b = [], []
    for p in range(len(x)):
        r = np.hypot(*(x - x[p]).T)
        q = np.where((r > 0) & (r <= m * (1 + 1e-9)))[0]
        a += [p] * np.sum(q > p)
        b += list(q[q > p])
    a, b = np.array(a), np.array(b)
    xi = x[b] - x[a]
    length = np.hypot(*xi.T)
    moment = np.bincount(a, length, len(x)) + np.bincount(b, length, len(x))
    c = 6 / moment  # micromodulus, each from its own family
    return x, a, b, xi, length, 0.5 * (c[a] + c[b]) / length


def main(m):
    x, a, b, xi, length, k = body(m)
    n = len(x)
    direction = xi / length[:, None]
    dofs = np.stack([2 * a, 2 * a + 1, 2 * b, 2 * b + 1], 1)
    row = np.concatenate([-direction, direction], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x[a, 0] - x[a, 1] / xi[:, 1] * xi[:, 0]
    crossing = x[a, 1] * x[b, 1] < 0
    alive = ~(crossing & (at <= START))
    stiffness = np.zeros((2 * n, 2 * n))
    for i in range(4):
        for j in range(4):
            np.add.at(stiffness, (dofs[alive, i], dofs[alive, j]), k[alive] * row[alive, i] * row[alive, j])
    up, low = (x[:, 0] < 2) & (x[:, 1] > 3), (x[:, 0] < 2) & (x[:, 1] < -3)
    fixed, unit = np.zeros(2 * n, bool), np.zeros(2 * n)
    for points, value in ((up, 1.0), (low, -1.0)):
        fixed[2 * np.where(points)[0] + 1] = True
        unit[2 * np.where(points)[0] + 1] = value
    fixed[2 * np.argmin(np.hypot(x[:, 0] - NX + 0.5, x[:, 1] - 0.5))] = True
    free = np.where(~fixed)[0]
    compliance = np.zeros((2 * n, 2 * n))
    compliance[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
    u = unit - compliance @ (stiffness @ unit)
    u[fixed] = unit[fixed]
    kc = k * np.einsum("bi,bij,bj->b", row, compliance[dofs[:, :, None], dofs[:, None, :]], row)
    print(f"horizon ratio {m}: sum of k c over the bonds {np.sum(kc[alive]):.6f}, free components {len(free)}")
    # a bond of the middle, and what a straight crack breaks per spacing: s0 = 1 makes G_c of it
    middle = crossing & (at > 18) & (at <= 22) & (np.abs(x[a, 0] - 20) < 10)
    per_spacing = np.sum(middle) / 4
    g_c = 0.5 * np.sum(k[middle] * length[middle] ** 2) / 4
    stored = released = load = 0.0
    broken, each, history = 0, [], []
    while True:
        e = np.einsum("bi,bi->b", row, u[dofs])
        s = np.where(alive & crossing, e / length, -1.0)
        worst = np.argmax(s)
        if s[worst] <= 0 or x[a[worst], 0] > 24:
            break
        load = max(load, 1 / s[worst])
        g = row[worst]
        column = compliance[:, dofs[worst]] @ g
        own = k[worst] * g @ column[dofs[worst]]
        w = 0.5 * k[worst] * (load * e[worst]) ** 2
        stored, released = stored + w, released + w / (1 - own)
        each.append(own)
        broken += 1
        history.append((broken, stored, released))
        # Sherman and Morrison
        compliance += k[worst] / (1 - own) * np.outer(column, column)
        u += k[worst] * e[worst] / (1 - own) * column
        alive[worst] = False
    history = np.array(history)
    # steady growth: leave the first three spacings out
    start = int(3 * per_spacing)
    span = history[-1] - history[start]
    area = span[0] / per_spacing
    print(f"  {broken} bonds broken, {per_spacing:.0f} a spacing; k c of the bonds that break: mean {np.mean(each[start:]):.3f}, {min(each[start:]):.3f} to {max(each[start:]):.3f}")
    print(f"  over G_c times the area: held by the bonds when they broke {span[1] / g_c / area:.4f}, taken out of the body {span[2] / g_c / area:.4f}")


if __name__ == "__main__":
    for m in (3.015, 4.015):
        main(m)
