"""Displacement error and wave speed of the semi-discrete bar of deck.yaml, by another road.

Central differences on u'' of a lattice where every point pulls its three neighbours on each side:
    rho u_tt = E / (h * 6) * sum_k (u[i+k] - 2 u[i] + u[i-k]) / (k h),   k = 1, 2, 3
Run: python reference.py
"""
import numpy as np

E, RHO, V, T, L, END, AREA = 210e9, 7850.0, 2.0, 10e-6, 0.2, 30e-6, 4e-6
C = np.sqrt(E / RHO)


def exact(x, t):
    return V * T / np.pi * (1 - np.cos(np.pi * np.clip(t - x / C, 0, T) / T))


def run(n, steps):
    h, dt = L / n, END / steps
    x = (np.arange(n) + 0.5) * h
    driven = x < 6.03 * h
    u = np.zeros(n)
    before = np.zeros(n)
    for step in range(steps):
        force = np.zeros(n)
        for k in (1, 2, 3):
            pull = (u[k:] - u[:-k]) / (k * h)
            force[:-k] += pull
            force[k:] -= pull
        after = 2 * u - before + dt**2 * E / (6 * h) / RHO * force
        before, u = u, after
        u[driven] = exact(x[driven], (step + 1) * dt)
    return np.sqrt(np.sum((u - exact(x, END)) ** 2) * h * AREA)


if __name__ == "__main__":
    size = np.sqrt(np.sum(exact((np.arange(100000) + 0.5) * L / 1e5, END) ** 2) * L / 1e5 * AREA)
    print(f"norm of the solution {size:.4e} m^2.5")
    previous = None
    for n in (200, 400, 800):
        error = run(n, 20 * n)
        ratio = "" if previous is None else f", {error / previous:.3f} of the previous"
        print(f"n = {n}: error {error:.4e} m^2.5, relative {error / size:.3e}{ratio}")
        previous = error
