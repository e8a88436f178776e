"""The plate of orthotropic.yaml by gradient operators and dense linear algebra, with numpy alone: reactions and one displacement.

Small strain: F - 1 = sum_j eta_j (x) g_j with g_j = V K^-1 xi_j; the energy of a point is eps:C:eps/2 + sum_j V z.C1 z/2 with z = eta - (F - 1) xi and
(C1)_ij = C_ijkl (K^-1)_kl (Wan et al. 2019), each over the bonds of its family.
"""
import numpy as np


def stiffness(angle):
    """Plane-strain stiffness C_ijkl of a lamina with axes turned by `angle` degrees."""
    e, g, n = (140e9, 10e9, 9e9), (3e9, 5e9, 6e9), (0.4, 0.3, 0.25)  # E1 E2 E3; G23 G13 G12; nu23 nu13 nu12
    s = np.array([[1 / e[0], -n[2] / e[0], -n[1] / e[0]], [-n[2] / e[0], 1 / e[1], -n[0] / e[1]], [-n[1] / e[0], -n[0] / e[1], 1 / e[2]]])
    c = np.linalg.inv(s)
    t = np.zeros((2, 2, 2, 2))
    t[0, 0, 0, 0], t[1, 1, 1, 1], t[0, 0, 1, 1], t[1, 1, 0, 0] = c[0, 0], c[1, 1], c[0, 1], c[1, 0]
    t[0, 1, 0, 1] = t[0, 1, 1, 0] = t[1, 0, 0, 1] = t[1, 0, 1, 0] = g[2]
    w = np.radians(angle)
    r = np.array([[np.cos(w), -np.sin(w)], [np.sin(w), np.cos(w)]])
    return np.einsum("ia,jb,kc,ld,abcd", r, r, r, r, t)


def solve(q, m, control, angle=30.0, pull=1e-8):
    dx = 1.0 / q
    cells = [(i, j) for j in range(-q // 4, q // 4) for i in range(-q // 2, q // 2) if abs(2 * i + 1) + abs(2 * j + 1) > q / 4]
    x = np.array([[(i + 0.5) * dx, (j + 0.5) * dx] for i, j in cells])
    n, v, c = len(x), dx * dx, stiffness(angle)
    k = np.zeros((2 * n, 2 * n))
    for p in range(n):
        xi = x - x[p]
        r = np.hypot(*xi.T)
        near = np.where((r > 0) & (r <= m * np.sqrt(2) * dx * (1 + 1e-9)))[0]
        xi = xi[near]
        inverse = np.linalg.inv(v * xi.T @ xi)
        # gradient of u: columns are the near points, then the point itself
        g = v * xi @ inverse
        g = np.vstack([g, -g.sum(0)])
        dofs = np.concatenate([near, [p]])
        size = len(dofs)
        # H_ab = sum_c u_a(c) g_c,b: energy V H:C:H/2
        block = v * np.einsum("cb,abde,fe->cafd", g, c, g).reshape(2 * size, 2 * size)
        if control:
            a = np.einsum("ijkl,kl", c, inverse)
            # z_j = u_j - u_p - H xi_j = sum_c z[j, c] u_c
            z = -xi @ g.T
            z[np.arange(len(near)), np.arange(len(near))] += 1
            z[:, -1] -= 1
            block += v * v * np.einsum("jc,jd,ab->cadb", z, z, a).reshape(2 * size, 2 * size)
        index = (2 * dofs[:, None] + np.arange(2)).ravel()
        k[np.ix_(index, index)] += block
    left, right = x[:, 0] < -0.5 + dx, x[:, 0] > 0.5 - dx
    fixed, u = np.zeros(2 * n, bool), np.zeros(2 * n)
    for points, value in ((left, -pull), (right, pull)):
        fixed[2 * np.where(points)[0]] = True
        u[2 * np.where(points)[0]] = value
    held = np.argmin(np.hypot(x[:, 0] + 0.5 - dx / 2, x[:, 1] - dx / 2))
    fixed[2 * held + 1] = True
    free = ~fixed
    u[free] = np.linalg.solve(k[np.ix_(free, free)], -k[np.ix_(free, fixed)] @ u[fixed])
    reaction = (k @ u)[2 * np.where(right)[0]].sum()
    corner = np.argmin(np.hypot(x[:, 0] - 0.5 + dx / 2, x[:, 1] - 0.25 + dx / 2))
    return reaction, u[2 * corner + 1]


if __name__ == "__main__":
    for m, control in ((1.1, False), (1.1, True), (2.1, False), (2.1, True)):
        reaction, tip = solve(40, m, control)
        print(f"horizon {m} diagonals, {'Wan 2019' if control else 'none':8}  reaction {reaction:.8f}  u_y of the upper right corner {tip:.10e}")
