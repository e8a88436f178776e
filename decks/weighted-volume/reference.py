"""Energy density beside a crack in a linear solid that is stretched evenly, u = s x, plane strain: closed forms.

All bonds grow by e = s |xi|. With phi the share of the weighted volume m whose bonds are intact,
    reference:  theta = 2 s phi, W = 2 s^2 phi^2 (kappa - 2 G) + 4 G s^2 phi
    intact:     theta = 2 s,     W = 2 s^2 kappa     (m is made of the same bonds as the integrals)
with the area modulus kappa = lambda + G.

    python reference.py
"""
E, NU, S, M = 70e9, 0.22, 1e-3, 3.015
G = E / (2 * (1 + NU))
KAPPA = E * NU / ((1 + NU) * (1 - 2 * NU)) + G
R = range(-3, 4)
bonds = [(i, j) for i in R for j in R if 0 < i * i + j * j <= M * M]
m = sum(i * i + j * j for i, j in bonds)
for row in (0, 1, 2, 3):
    # the crack lies half a spacing below row 0
    phi = sum(i * i + j * j for i, j in bonds if j >= -row) / m
    print(f"row {row}: phi = {phi:.6f}, theta = {2 * S * phi!r}, W = {2 * S**2 * phi**2 * (KAPPA - 2 * G) + 4 * G * S**2 * phi!r}")
print(f"intact: theta = {2 * S!r}, W = {2 * S**2 * KAPPA!r}")
