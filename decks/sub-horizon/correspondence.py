"""Small-strain correspondence on any cloud of points: full families, sub-horizons, the control of Wan et al. (2019).

A plain reference for the decks of this folder (dense loops, a few hundred points). Influence 1, closed balls. A sub-horizon
is dropped where its shape tensor has an eigenvalue ratio below `ratio`; the others of the point carry the energy; where none
is left the full family does.
"""
import itertools

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu


def stiffness_tensor(young, poisson, d):
    """C_ijkl of an isotropic solid; plane strain for d = 2."""
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    e = np.eye(d)
    return (
        lam * np.einsum("ij,kl->ijkl", e, e)
        + mu * np.einsum("ik,jl->ijkl", e, e)
        + mu * np.einsum("il,jk->ijkl", e, e)
    )


def full(xi):
    return [np.full(len(xi), True)]


def orthants(xi):
    """Closed quadrants or octants."""
    tiny = 1e-9 * np.abs(xi).max()
    return [np.all(xi * np.array(signs) >= -tiny, axis=1) for signs in itertools.product((1, -1), repeat=xi.shape[1])]


def sectors(number, start=0.0):
    """Equal closed sectors of the plane, the first from the angle `start` on."""

    def members(xi):
        turn = (np.arctan2(xi[:, 1], xi[:, 0]) - start) / (2 * np.pi) * number
        return [(np.mod(turn - a + 1e-9, number) <= 1 + 2e-9) for a in range(number)]

    return members


def families(x, horizon):
    from scipy.spatial import cKDTree

    tree = cKDTree(x)
    return [np.array([j for j in sorted(near) if j != i]) for i, near in enumerate(tree.query_ball_point(x, horizon * (1 + 1e-9)))]


def gradients(x, volume, near, split, ratio):
    """For each point a list of (neighbours, rows of V K^-1 xi, bonds, K^-1)."""
    result, dropped, whole = [], 0, 0
    for i, family in enumerate(near):
        xi = x[family] - x[i]
        kept = []
        for member in split(xi):
            k = np.einsum("na,nb,n->ab", xi[member], xi[member], volume[family[member]])
            values = np.linalg.eigvalsh(k)
            if values[0] > ratio * values[-1]:
                inverse = np.linalg.inv(k)
                kept.append((family[member], (xi[member] @ inverse) * volume[family[member]][:, None], xi[member], inverse))
            else:
                dropped += 1
        if not kept:
            whole += 1
            k = np.einsum("na,nb,n->ab", xi, xi, volume[family])
            inverse = np.linalg.inv(k)
            kept.append((family, (xi @ inverse) * volume[family][:, None], xi, inverse))
        result.append(kept)
    return result, dropped, whole


def assemble(x, volume, rows, c, wan=False):
    """Sparse stiffness."""
    n, d = x.shape
    r, s, v = [], [], []
    for i, kept in enumerate(rows):
        for family, g, xi, inverse in kept:
            points = np.append(family, i)
            b = np.vstack([g, -g.sum(axis=0)])
            k = np.einsum("pj,ijkl,ql->piqk", b, c, b) * volume[i] / len(kept)
            if wan:
                a = np.einsum("ijkl,kl->ij", c, inverse)
                m = len(family)
                z = np.hstack([np.eye(m), -np.ones((m, 1))]) - xi @ b.T
                k += volume[i] * np.einsum("zp,zq,z,ij->piqj", z, z, volume[family], a)
            dof = (points[:, None] * d + np.arange(d)).ravel()
            r.append(np.repeat(dof, len(dof)))
            s.append(np.tile(dof, len(dof)))
            v.append(k.reshape(len(dof), len(dof)).ravel())
    return coo_matrix((np.concatenate(v), (np.concatenate(r), np.concatenate(s))), shape=(n * d, n * d)).tocsc()


def solve(k, held):
    """Displacements with dof -> value in `held`, and the forces."""
    u = np.zeros(k.shape[0])
    dofs = np.array(sorted(held))
    u[dofs] = [held[dof] for dof in dofs]
    free = np.setdiff1d(np.arange(len(u)), dofs)
    lu = splu(k[free][:, free])
    u[free] = lu.solve(-(k[free] @ u))
    u[free] += lu.solve(-(k[free] @ u))
    return u, k @ u
