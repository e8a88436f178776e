"""Writes the decks of this folder, with reference values computed from scratch.

Everything is done with full tensors of rank four in three dimensions; plane stress and the bar free their transverse
stretches by bisection or condensation. Nothing here is taken from the program. Run with numpy: python write_decks.py
"""
import itertools
import json

import numpy as np

E, NU = 200e9, 0.3
ORTHOTROPIC = dict(e1=140e9, e2=10e9, e3=12e9, g12=5e9, g13=6e9, g23=3.5e9, nu12=0.3, nu13=0.28, nu23=0.45)
ANGLE = 0.4
VOIGT = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]


def lame(e, nu):
    return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))


def isotropic(e, nu):
    lam, mu = lame(e, nu)
    d = np.eye(3)
    return (lam * np.einsum("ij,kl->ijkl", d, d)
            + mu * (np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d)))


def tensor(voigt):
    c = np.zeros((3, 3, 3, 3))
    for (a, (i, j)), (b, (k, l)) in itertools.product(enumerate(VOIGT), enumerate(VOIGT)):
        for p, q in {(i, j), (j, i)}:
            for r, s in {(k, l), (l, k)}:
                c[p, q, r, s] = voigt[a, b]
    return c


def voigt(c):
    return np.array([[c[i, j, k, l] for k, l in VOIGT] for i, j in VOIGT])


def orthotropic(e1, e2, e3, g12, g13, g23, nu12, nu13, nu23):
    s = np.diag([1 / e1, 1 / e2, 1 / e3, 1 / g23, 1 / g13, 1 / g12])
    s[0, 1] = s[1, 0] = -nu12 / e1
    s[0, 2] = s[2, 0] = -nu13 / e1
    s[1, 2] = s[2, 1] = -nu23 / e2
    return tensor(np.linalg.inv(s))


def turned(c, r):
    return np.einsum("ia,jb,kc,ld,abcd->ijkl", r, r, r, r, c)


def about_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def root(f, low, high):
    """The zero of a rising f."""
    for _ in range(200):
        middle = (low + high) / 2
        if f(middle) > 0:
            high = middle
        else:
            low = middle
    return middle


def quadratic(c, strain, free):
    """Energy, stress and whole strain of a quadratic law where the strain components `free` adjust to no stress."""
    cv = voigt(c)
    e = np.array([strain[0, 0], strain[1, 1], strain[2, 2], 2 * strain[1, 2], 2 * strain[0, 2], 2 * strain[0, 1]])
    held = [k for k in range(6) if k not in free]
    if free:
        e[free] = -np.linalg.solve(cv[np.ix_(free, free)], cv[np.ix_(free, held)] @ e[held])
    s = cv @ e
    full = lambda v, g: np.array([[v[0], v[5] / g, v[4] / g], [v[5] / g, v[1], v[3] / g], [v[4] / g, v[3] / g, v[2]]])
    return e @ s / 2, full(s, 1), full(e, 2)


FREE = {"bar": [1, 2, 3, 4, 5], "plane stress": [2, 3, 4], "plane strain": [], "solid": []}


def in_plane_volume(F, section):
    """Determinant of the part of F that the model sees.

    The program reports P F^T / J with J of the dimension of space: where transverse directions contract freely that is
    the Cauchy stress times their stretch, a force per reference thickness (plane stress) or cross-section (bar).
    """
    d = SECTIONS[section]["dimension"]
    return np.linalg.det(F[:d, :d])


def small(c, H, section):
    w, s, _ = quadratic(c, (H + H.T) / 2, FREE[section])
    return w, None


def saint_venant(c, H, section):
    F = np.eye(3) + H
    green = (F.T @ F - np.eye(3)) / 2
    w, s, e = quadratic(c, green, FREE[section])
    if section == "bar":
        return w, F @ s @ F.T / F[0, 0]
    if section == "plane stress":
        F[2, 2] = np.sqrt(1 + 2 * e[2, 2])
    return w, F @ s @ F.T / in_plane_volume(F, section)


def neo_hookean(H, section, e=E, nu=NU):
    lam, mu = lame(e, nu)
    F = np.eye(3) + H
    axes = {"bar": [1, 2], "plane stress": [2]}.get(section, [])

    def with_stretch(c):
        G = F.copy()
        for a in axes:
            G[a, a] = c
        return G

    if axes:
        c = root(lambda c: mu * (c * c - 1) + lam * np.log(np.linalg.det(with_stretch(c))), 0.5, 2)
        F = with_stretch(c)
    J = np.linalg.det(F)
    w = mu / 2 * (np.trace(F.T @ F) - 3 - 2 * np.log(J)) + lam / 2 * np.log(J) ** 2
    sigma = (mu * (F @ F.T - np.eye(3)) + lam * np.log(J) * np.eye(3)) / in_plane_volume(F, section)
    return w, sigma


def almansi(H, section, e=E, nu=NU):
    F = np.eye(3) + H
    inverse = np.linalg.inv(F)
    strain = (np.eye(3) - inverse.T @ inverse) / 2
    free = FREE[section]
    _, s, strain = quadratic(isotropic(e, nu), strain, free)
    stretch = 1 / np.sqrt(1 - 2 * strain[2, 2])
    return None, s * {"bar": stretch**2, "plane stress": stretch}.get(section, 1)


def number(x):
    return repr(float(x))


SECTIONS = {
    "bar": dict(dimension=1, n=30, layer=7, horizon=3.015),
    "plane strain": dict(dimension=2, n=20, layer=7, horizon=3.015),
    "plane stress": dict(dimension=2, n=20, layer=7, horizon=3.015),
    "solid": dict(dimension=3, n=14, layer=5, horizon=2.015),
}
GRADIENT = np.array([[0.04, -0.03, 0.02], [0.06, -0.02, 0.05], [-0.01, 0.03, 0.03]])
AXES = "xyz"


def flow(x):
    return json.dumps(x).replace('"', "")


def gradient(section, size):
    d = SECTIONS[section]["dimension"]
    H = np.zeros((3, 3))
    H[:d, :d] = GRADIENT[:d, :d] * size
    return H


def runs(section):
    """Name, model, size of the gradient relative to GRADIENT, energy, stress, jitter."""
    d = SECTIONS[section]["dimension"]
    iso = {"youngs_modulus": E, "poisson_ratio": NU}
    c_iso, c_ort = isotropic(E, NU), orthotropic(**ORTHOTROPIC)
    ortho = {"orthotropic": ORTHOTROPIC, "orientation": {"angle": ANGLE}}
    c_turned = turned(c_ort, about_z(ANGLE))
    H, tiny = gradient(section, 1), gradient(section, 1e-7)
    corr = lambda law, control="wan_2019_objective", **rest: {"correspondence": {"law": law, "control": control, **rest}}
    laws = {
        "linear": ({"linear_elastic": iso}, small(c_iso, H, section)),
        "saint-venant": ({"saint_venant_kirchhoff": iso}, saint_venant(c_iso, H, section)),
        "neo-hookean": ({"neo_hookean": iso}, neo_hookean(H, section)),
        "almansi": ({"almansi": iso}, almansi(H, section)),
        "kelvin-voigt": ({"kelvin_voigt": {"retardation_time": 1e-6, **iso}}, small(c_iso, H, section)),
        "orthotropic-linear": ({"linear_elastic": ortho}, small(c_turned, H, section)),
        "orthotropic-saint-venant": ({"saint_venant_kirchhoff": ortho}, saint_venant(c_turned, H, section)),
    }
    if d == 3:
        r = np.array([[2, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 3
        c_axes = turned(c_ort, r)
        laws["axes-saint-venant"] = ({"saint_venant_kirchhoff": {"orthotropic": ORTHOTROPIC, "orientation": {
            "axes": [[2, 2, -1], [-1, 2, 2]]}}}, saint_venant(c_axes, H, section))
        laws["anisotropic-saint-venant"] = ({"saint_venant_kirchhoff": {"anisotropic": {"voigt": voigt(c_axes).tolist()}}},
                                            saint_venant(c_axes, H, section))
    for name, (law, (w, s)) in laws.items():
        yield name, corr(law), 1, w, s, 0
    law, (w, s) = laws["saint-venant"]
    for name, control in [("none", "none"), ("wan", "wan_2019"), ("silling", {"silling_2017": {"strength": 0.5}})]:
        yield f"saint-venant-{name}", corr(law, control), 1, w, s, 0
    if section == "plane strain":
        for name, influence in [("inverse-length", "inverse_length"), ("cone", "cone"), ("gaussian", {"gaussian": {"width": 0.6}}),
                                ("spline", "cubic_spline"), ("expression", {"expression": "1 - r^2"})]:
            yield f"influence-{name}", corr(law, influence=influence), 1, w, s, 0
    yield "saint-venant-cloud", corr(law), 1, w, s, 0.3
    # bond-based and linear solid: small strain, isotropy corrected where a lattice is not isotropic by itself
    nu_bond = {"bar": 0, "plane strain": 0.25, "plane stress": 1 / 3, "solid": 0.25}[section]
    correction = {} if d == 1 else {"isotropy_correction": True}
    bond = {"youngs_modulus": E}
    yield "bond-based", {"bond_based": {**bond, **correction}}, 1e-7, small(isotropic(E, nu_bond), tiny, section)[0], None, 0
    if d == 1:
        yield "bond-based-finite", {"bond_based": bond}, 1, None, None, 0
        return
    yield "linear-solid", {"linear_peridynamic_solid": {**iso, **correction}}, 1e-7, small(c_iso, tiny, section)[0], None, 0
    # finite, as the models are: in the interior of a lattice the affine field is in equilibrium all the same
    yield "bond-based-finite", {"bond_based": bond}, 1, None, None, 0
    yield "linear-solid-finite", {"linear_peridynamic_solid": iso}, 1, None, None, 0


def deck(section):
    s = SECTIONS[section]
    d, n, layer = s["dimension"], s["n"], s["layer"]
    shape = {1: "line", 2: "rectangle", 3: "box"}[d]
    low, high = ("0", "n*dx") if d == 1 else (f"[{', '.join(['0'] * d)}]", f"[{', '.join(['n*dx'] * d)}]")
    inside = " && ".join(f"{a} > {layer}*dx && {a} < {n - layer}*dx" for a in AXES[:d])
    affine = ["size*(" + " + ".join(f"{GRADIENT[i, j]}*{AXES[j]}" for j in range(d)) + ")" for i in range(d)]
    largest = n * 1e-3 * max(abs(GRADIENT[i, :d]).sum() for i in range(d))
    out = f"""# yaml-language-server: $schema=../../deck.schema.json
title: "Affine patch test: {section}"
# Written by write_decks.py, which computes the references. An affine displacement is held on a layer of two horizons;
# the free interior must follow it to round-off, and store the energy of the law.
parameters:
  dx: 1 mm
  n: {n}
  size: 1
  jitter: 0
  held: layer
  model: {{bond_based: {{youngs_modulus: 200 GPa}}}}
body:
  dimension: {d}
"""
    if d == 2:
        out += f"  plane: {section.split()[1]}\n"
    out += f"""  points:
    - {shape}: {{from: {low}, to: {high}, spacing: dx, jitter: {{amplitude: jitter}}}}
  horizon: {s['horizon']}*dx
sets:
  inside: {{where: "{inside}"}}
  layer: {{not: inside}}
materials:
  sample:
    model: ${{model}}
conditions:
  - displacement:
      set: ${{held}}
      name: affine
"""
    for i in range(d):
        out += f'      {AXES[i]}: "{affine[i]}"\n'
    out += """solver:
  statics: {method: direct, tolerance: 1e-13}
output:
  frames: 1
  fields: [displacement, stress, energy_density]
runs:
"""
    middle = "[" + ", ".join(["n*dx/2 + dx/2"] * d) + "]"
    for name, model, size, energy, stress, jitter in runs(section):
        settings = {"model": model}
        if size != 1:
            settings["size"] = size
        if jitter:
            settings |= {"jitter": jitter, "held": "all"}
        out += f"  {name}:\n    set: {flow(settings)}\n    expect:\n"
        if not jitter:
            for i in range(d):
                out += (f'      - {{name: error of u_{AXES[i]}, error: {{field: displacement.{AXES[i]}, against: "{affine[i]}", norm: max}}, '
                        f"value: 0, absolute: {1e-12 * largest * size:.3e}, source: affine field}}\n")
        if energy is not None:
            tolerance = 1e-6 if size != 1 else 1e-11
            out += (f"      - {{field: energy_density, at: {middle}, value: {number(energy)}, tolerance: {tolerance}, "
                    f"source: closed form of the law}}\n")
        if stress is not None:
            for i, j in itertools.combinations_with_replacement(range(d), 2):
                out += (f"      - {{field: stress.{AXES[i]}{AXES[j]}, at: {middle}, value: {number(stress[i, j])}, absolute: {1e-11 * abs(stress).max():.3e}, "
                        f"source: closed form of the law}}\n")
    open(section.replace(" ", "-") + ".yaml", "w").write(out)


if __name__ == "__main__":
    for section in SECTIONS:
        deck(section)
