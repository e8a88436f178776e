"""Bloch symbols of the correspondence models on unit lattices (E = 1, nu = 1/4, influence 1). Run: python reference.py"""
import itertools
import sys

import numpy as np

sys.path.insert(0, "..")
sys.path.insert(0, "../../papers/chowdhury2019")
from bar import correction
from correspondence import full, orthants, sectors, stiffness_tensor


def lattice(d, horizon):
    m = int(horizon)
    xi = np.array(list(itertools.product(range(-m, m + 1), repeat=d)), float)
    r = np.linalg.norm(xi, axis=1)
    return xi[(r > 0) & (r <= horizon * (1 + 1e-9))]


def intervals(horizon, number):
    edges = np.linspace(-horizon, horizon, number + 1)
    return lambda xi: [(xi[:, 0] >= a - 1e-9) & (xi[:, 0] <= b + 1e-9) for a, b in zip(edges, edges[1:])]


def corrected(order):
    """1D: weights C(s) s / sum s^2 of the bonds."""

    def weights(xi, horizon):
        offsets = [int(o) for o in xi[:, 0]]
        return np.array([float(v) for v in correction(offsets, horizon, order)])[:, None]

    return weights


def symbol(k, horizon, d, c, split, control=None, weights=None):
    """The d x d matrix of a wave exp(i k.x), per volume."""
    xi = lattice(d, horizon)
    members = [m for m in split(xi) if rank(xi[m]) == d]  # the others are dropped
    result = np.zeros((d, d), complex)
    for m in members:
        b = xi[m]
        inverse = np.linalg.inv(b.T @ b)
        wave = np.exp(1j * b @ k) - 1
        g = inverse @ ((b if weights is None else b * weights(b, horizon)).T @ wave)
        result += np.einsum("j,ijkl,l->ik", g.conj(), c, g) / len(members)
        if control is not None:
            if control == "wan":
                a = np.einsum("ijkl,kl->ij", c, inverse)
            else:  # Silling: a strength
                area = {1: 2.0 / horizon**2, 2: 48 / (5 * np.pi * horizon**3), 3: 12 / (np.pi * horizon**4)}[d]
                a = control * area / horizon * np.eye(d)
            z = wave - b @ g
            result += np.sum(np.abs(z) ** 2) * a
    return result


def rank(bonds):
    return np.linalg.matrix_rank(bonds, tol=1e-6) if len(bonds) else 0


def speeds(k, symbol_value):
    return np.sqrt(np.linalg.eigvalsh(symbol_value)) / np.linalg.norm(k)


if __name__ == "__main__":
    c1 = np.ones((1, 1, 1, 1))
    print("1D, delta = 5.1: lowest symbol in the zone and where (k in pi), symbol at pi, speed at k delta = 1")
    k = np.linspace(0.02, 1, 491) * np.pi
    for name, split, control, weights in (
        ("conventional", full, None, None),
        ("corrected-4", full, None, corrected(4)),
        ("corrected-6", full, None, corrected(6)),
        ("wan", full, "wan", None),
        ("silling-1", full, 1.0, None),
        ("silling-0.1", full, 0.1, None),
        ("two", intervals(5.1, 2), None, None),
        ("four", intervals(5.1, 4), None, None),
    ):
        value = lambda q: symbol(np.array([q]), 5.1, 1, c1, split, control, weights)[0, 0].real
        ratio = np.array([value(q) / q**2 for q in k])
        half = np.sqrt(value(np.pi / 2)) / (np.pi / 2)
        print(f"  {name}: {ratio.min():.6e} at {k[ratio.argmin()] / np.pi:.3f}, {value(np.pi):.6e}, {np.sqrt(value(1 / 5.1)) * 5.1:.6f}, at pi/2 {half:.6f}")
    for m in (10, 100, 1000, 10000):
        text = []
        for count, split in ((1, full), (2, intervals(m, 2)), (4, intervals(m, 4))):
            q = np.pi / 2
            text.append(f"{m**2 * symbol(np.array([q]), m, 1, c1, split)[0, 0].real:.6f}")
        print(f"  delta = {m} dx, k = pi / 2 dx: delta^2 symbol / E with 1, 2, 4 sub-horizons: " + ", ".join(text))
    c2 = stiffness_tensor(1.0, 0.25, 2)
    longitudinal, transverse = np.sqrt(c2[0, 0, 0, 0]), np.sqrt(c2[0, 1, 0, 1])
    for h in (1.1 * np.sqrt(2), 3.1 * np.sqrt(2)):
        print(f"2D plane strain, delta = {h:.3f}: phase speeds over local at k delta = 1, 0 and 45 degrees (T, L); symbol at (pi, pi), (pi, 0)")
        for name, split, control in (
            ("conventional", full, None),
            ("wan", full, "wan"),
            ("silling-1", full, 1.0),
            ("closed quadrants", orthants, None),
            ("3 sectors", sectors(3), None),
            ("4 sectors", sectors(4), None),
            ("6 sectors", sectors(6), None),
        ):
            text = []
            for turn in (0, np.pi / 4):
                q = np.array([np.cos(turn), np.sin(turn)]) / h
                s = speeds(q, symbol(q, h, 2, c2, split, control))
                text.append(f"{s[0] / transverse:.4f} {s[1] / longitudinal:.4f}")
            for corner in ([np.pi, np.pi], [np.pi, 0]):
                values = np.linalg.eigvalsh(symbol(np.array(corner), h, 2, c2, split, control))
                text.append(" ".join(f"{v:.5g}" for v in values))
            print(f"  {name}: " + "; ".join(text))
    c3 = stiffness_tensor(1.0, 0.25, 3)
    for h in (1.1, 3.1):
        for name, split, control in (("conventional", full, None), ("wan", full, "wan"), ("octants", orthants, None)):
            values = np.linalg.eigvalsh(symbol(np.full(3, np.pi), h, 3, c3, split, control))
            print(f"3D, delta = {h}, {name}: symbol at (pi, pi, pi) {values}")
    print("Continuum limits: k delta = 4.4934 conventional", 3 * (np.sin(4.4934) - 4.4934 * np.cos(4.4934)) / 4.4934**3)
