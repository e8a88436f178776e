"""Local and nonlocal deformation gradients of y = x + a sin(2 pi x / L), a = 0.9 L / (2 pi), delta = L / 2, in the continuum.

With q = 2 pi delta / L = pi every gradient is 1 + g 0.9 cos(2 pi x / L), because families are symmetric:
g = int C(s) s sin(q s) ds / (q int s^2 ds), C the correction of order N with moments over [-1, 1]. Run: python reference.py
"""
import numpy as np

S, W = np.polynomial.legendre.leggauss(40)


def correction(order):
    moment = lambda n: np.sum(W * S**n)
    m = np.array([[moment(a + b + 2) for b in range(order)] for a in range(order)])
    c = np.linalg.solve(m, [moment(2)] + [0] * (order - 1))
    return np.polynomial.polynomial.polyval(S, c)


def factor(order, q):
    return np.sum(W * correction(order) * S * np.sin(q * S)) / (q * np.sum(W * S**2))


if __name__ == "__main__":
    print(f"closed form, N = 1, 2: g = 3 / pi^2 = {3 / np.pi**2:.12f}")
    for order in range(1, 9):
        g = factor(order, np.pi)
        fall = [1 - factor(order, np.pi / 2**i) for i in (2, 3)]
        print(f"N = {order}: g = {g:.12f}, gradient at x = 0: {1 + 0.9 * g:.8f}, observed order {np.log2(fall[0] / fall[1]):.2f}")
    # quadrature points of one family, for the run `family` of the deck: the horizon is 1 / 2 of L = 0.2 m
    with open("family.csv", "w") as out:
        out.write("x,volume\n0.0,0.008\n")
        s, w = np.polynomial.legendre.leggauss(24)
        for a, b in zip(s, w):
            out.write(f"{0.1 * a:.17g},{0.1 * b:.17g}\n")
