"""What a pulse leaves behind in a bar, by Fourier series and the symbol of each model. Run: python reference.py

Velocity Verlet from rest moves a mode of frequency w as cos(n v), sin(v / 2) = w dt / 2, so that the deck should agree to
round-off as long as nothing comes back from the ends.
"""
import sys

import numpy as np

sys.path.insert(0, "../../papers/chowdhury2019")
from bar import correction, sub_horizons

N, RATIO, WIDTH, END, STEPS = 1001, 5.1, 5, 0.4, 8000


def symbol(k, count=1, order=1, wan=False):
    """dx^2 times the stiffness of a wave exp(i k j) per volume and Young's modulus."""
    total = np.zeros(len(k))
    sets = sub_horizons(RATIO, count) if count > 1 else [[o for o in range(-5, 6) if o]]
    for offsets in sets:
        c = np.array([float(v) for v in correction(offsets, RATIO, order)])
        o = np.array(offsets)
        g = c * o / np.sum(o**2)
        wave = np.exp(1j * np.outer(k, o)) - 1
        total += np.abs(wave @ g) ** 2 / len(sets)
        if wan:
            total += np.sum(np.abs(wave - np.outer(wave @ g, o)) ** 2, axis=1) / np.sum(o**2)
    return total


MODELS = {
    "conventional": {},
    "corrected-6": {"order": 6},
    "wan": {"wan": True},
    "two": {"count": 2},
    "four": {"count": 4},
}

if __name__ == "__main__":
    dx, dt = 1e-3, END / STEPS
    j = np.arange(N) - N // 2
    k = 2 * np.pi * np.fft.fftfreq(N)
    start = np.exp(-((j / WIDTH) ** 2))
    ends = {}
    for name, model in MODELS.items():
        v = 2 * np.arcsin(np.sqrt(symbol(k, **model)) / dx * dt / 2)
        u = np.fft.ifft(np.fft.fft(start) * np.cos(STEPS * v)).real
        ends[name] = u
        near = np.abs(j) <= 100
        print(
            f"{name}: at the origin {u[N // 2]:.6e}, largest |u| for |x| < 0.1 {np.abs(u[near]).max():.6e}, "
            f"peak {u.max():.6e} at {abs(j[np.argmax(u)]) * dx:.3f}, at the ends {np.abs(u[:20]).max():.0e}, "
            f"symbol at k = pi {symbol(np.array([np.pi]), **model)[0]:.3g}"
        )
