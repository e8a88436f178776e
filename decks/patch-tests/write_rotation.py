"""Writes the decks of rotation, with reference values from a direct double sum over the bonds of a small free lattice."""
import itertools

import numpy as np
from write_decks import AXES, E, NU, ORTHOTROPIC, ANGLE, SECTIONS, flow, isotropic, lame, number, orthotropic

TURN = 0.8
DX = 1e-3
SIZES = {2: (9, 7), 3: (6, 5, 5)}
RATIO = {2: 3.015, 3: 2.015}
AXIS = {2: np.array([0, 0, 1.0]), 3: np.array([1, 2, 3.0])}


def rotation(axis, angle):
    a = axis / np.linalg.norm(axis)
    k = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def bend(x):
    """A displacement that is not affine, on the scale of the body."""
    d = x.shape[1]
    length = SIZES[d][0] * DX
    s = x / length
    u = np.zeros_like(x)
    u[:, 0] = 0.1 * s[:, 0] * s[:, 1]
    u[:, 1] = 0.08 * s[:, 0] ** 2 - 0.05 * s[:, 1] ** 2
    if d == 3:
        u[:, 2] = 0.06 * s[:, 0] * s[:, 2]
    return u * length


BEND = {2: ["0.1*x*y/L", "(0.08*x^2 - 0.05*y^2)/L"], 3: ["0.1*x*y/L", "(0.08*x^2 - 0.05*y^2)/L", "0.06*x*z/L"]}


class Lattice:
    def __init__(self, d):
        self.d = d
        self.x = np.array(list(itertools.product(*[(np.arange(n) + 0.5) * DX for n in SIZES[d]])))
        self.v = DX**d * (1.0 if d == 2 else 1)
        delta = RATIO[d] * DX
        self.families = []
        for i, xi in enumerate(self.x):
            r = np.linalg.norm(self.x - xi, axis=1)
            self.families.append([j for j in range(len(self.x)) if j != i and r[j] <= delta * (1 + 1e-9)])
        c = isotropic(E, NU)
        self.c = c[:d, :d, :d, :d]

    def energy(self, u, control):
        """Saint-Venant-Kirchhoff and Wan's control, as published or with the mean of its tensor."""
        total = 0
        d = self.d
        for i, family in enumerate(self.families):
            xi, eta = self.x[family] - self.x[i], u[family] - u[i]
            inverse = np.linalg.inv(xi.T @ xi * self.v)
            H = eta.T @ xi * self.v @ inverse
            F = H + np.eye(d)
            green = (F.T @ F - np.eye(d)) / 2
            w = np.einsum("ij,ijkl,kl", green, self.c, green) / 2
            z = eta - xi @ H.T
            c1 = np.einsum("ijkl,kl", self.c, inverse)
            if control == "wan_2019_objective":
                c1 = np.eye(d) * np.trace(c1) / d
            w += np.einsum("bi,ij,bj", z, c1, z) * self.v / 2
            total += w * self.v
        return total

    def linear_force(self, u):
        """Largest force density of the small-strain law without control."""
        d = self.d
        f = np.zeros_like(self.x)
        for i, family in enumerate(self.families):
            xi, eta = self.x[family] - self.x[i], u[family] - u[i]
            inverse = np.linalg.inv(xi.T @ xi * self.v)
            H = eta.T @ xi * self.v @ inverse
            stress = np.einsum("ijkl,kl", self.c, (H + H.T) / 2)
            T = xi @ inverse.T @ stress.T
            f[i] += T.sum(axis=0) * self.v
            f[family] -= T * self.v
        return f


def deck(d):
    lattice = Lattice(d)
    sizes = SIZES[d]
    R = rotation(AXIS[d], TURN)[:d, :d]
    low = "[" + ", ".join("0" for _ in sizes) + "]"
    high = "[" + ", ".join(f"{n}*dx" for n in sizes) + "]"
    names = AXES[:d]
    entries = {f"r{names[i]}{names[j]}": R[i, j] for i in range(d) for j in range(d)}
    moved = []
    for i in range(d):
        terms = " + ".join(f"(r{names[i]}{names[j]}*turned + {int(i == j)}*(1 - turned))*({names[j]} + bent*{BEND[d][j]})" for j in range(d))
        moved.append(f"{terms} - {names[i]}")
    out = f"""# yaml-language-server: $schema=../../deck.schema.json
title: "Rigid rotation by 0.8 rad, {d}D"
# Written by write_rotation.py, which computes the references. A free body is turned: no force may act in it. Then it is
# bent and turned: its energy may not change.
parameters:
  dx: 1 mm
  L: {sizes[0]}*dx
  turned: 1
  bent: 0
  jitter: 0
"""
    for name, value in entries.items():
        out += f"  {name}: {number(value)}\n"
    out += f"""  # no more than 1e-9 E/L
  small: 1e-9*200e9/{sizes[0] * DX}
  model: {{bond_based: {{youngs_modulus: 200 GPa}}}}
body:
  dimension: {d}
"""
    if d == 2:
        out += "  plane: strain\n  thickness: 1 m\n"
    out += f"""  points:
    - {'rectangle' if d == 2 else 'box'}: {{from: {low}, to: {high}, spacing: dx, jitter: {{amplitude: jitter}}}}
  horizon: {RATIO[d]}*dx
materials:
  sample:
    density: 8000 kg/m^3
    model: ${{model}}
conditions:
  - initial_displacement:
      set: all
"""
    for i in range(d):
        out += f'      {names[i]}: "{moved[i]}"\n'
    out += """solver:
  velocity_verlet: {steps: 1, step: 1e-15 s}
output:
  frames: 1
  fields: [displacement, force_density]
runs:
"""
    iso = {"youngs_modulus": E, "poisson_ratio": NU}
    corr = lambda law, control, **rest: {"correspondence": {"law": law, "control": control, **rest}}
    laws = {"saint-venant": {"saint_venant_kirchhoff": iso}, "neo-hookean": {"neo_hookean": iso},
            "orthotropic": {"saint_venant_kirchhoff": {"orthotropic": ORTHOTROPIC, "orientation": {"angle": ANGLE}}},
            "almansi": {"almansi": iso}}
    models = {f"{name}-{tag}": corr(law, control) for name, law in laws.items()
              for tag, control in [("none", "none"), ("objective", "wan_2019_objective"), ("wan", "wan_2019"),
                                   ("silling", {"silling_2017": {"strength": 1}})]
              if tag in ("objective", "wan") or name == "saint-venant"}
    models["bond-based"] = {"bond_based": {"youngs_modulus": E, "isotropy_correction": False}}
    models["linear-solid"] = {"linear_peridynamic_solid": iso}
    for name, model in models.items():
        for tag, jitter in [("", 0), ("-cloud", 0.3)]:
            settings = {"model": model} | ({"jitter": jitter} if jitter else {})
            out += f"  {name}{tag}:\n    set: {flow(settings)}\n    expect:\n"
            for a in names:
                out += (f"      - {{field: force_density.{a}, over: all, reduce: max_abs, value: 0, absolute: small, "
                        f"source: a rigid rotation strains nothing}}\n")
    # what fails, with the size of its failure
    u = lattice.x @ (R - np.eye(d)).T
    f = lattice.linear_force(u)
    out += "  # the small-strain law takes a rotation for a strain: forces of this size are its property, not an error\n"
    out += f"  linear-elastic:\n    set: {flow({'model': corr({'linear_elastic': iso}, 'wan_2019_objective')})}\n    expect:\n"
    for a, value in zip(names, abs(f).max(axis=0)):
        out += (f"      - {{field: force_density.{a}, over: all, reduce: max_abs, value: {number(value)}, tolerance: 1e-9, "
                f"source: direct double sum}}\n")
    bent = bend(lattice.x)
    for control in ["wan_2019_objective", "wan_2019"]:
        if control == "wan_2019":
            out += "  # the control as published: the energy changes with the rotation, as the formula says\n"
        for tag, displacement, turned in [("bent", bent, 0), ("bent-turned", (lattice.x + bent) @ R.T - lattice.x, 1)]:
            value = lattice.energy(displacement, control)
            out += f"  {control.replace('_', '-')}-{tag}:\n    set: {flow({'model': corr({'saint_venant_kirchhoff': iso}, control), 'bent': 1, 'turned': turned})}\n"
            out += f"    expect:\n      - {{quantity: energy.strain, time: 0, value: {number(value)}, tolerance: 1e-11, source: direct double sum}}\n"
            print(d, control, tag, value)
    open(f"rotation-{'plane' if d == 2 else 'solid'}.yaml", "w").write(out)


if __name__ == "__main__":
    deck(2)
    deck(3)
