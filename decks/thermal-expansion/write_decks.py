"""Writes solid.yaml and plane.yaml: a neo-Hookean solid that is heated, free and restrained, with references in closed form.

psi(F/theta) with theta = 1 + alpha dT and psi = mu/2 (I1 - 3 - 2 ln J) + lambda/2 (ln J)^2. Where a direction is free its elastic stretch c
solves mu (c^2 - 1) + lambda ln J = 0; bisection here.

    python write_decks.py
"""
from math import log

E, NU, ALPHA, DT = 200e9, 0.3, 1.2e-5, 2000.0
MU, LAMBDA = E / (2 * (1 + NU)), E * NU / ((1 + NU) * (1 - 2 * NU))
THETA = 1 + ALPHA * DT


def free_stretch(known, n):
    """Elastic stretch of n free directions, given the product of the others."""
    low, high = 0.5, 2.0
    for _ in range(200):
        c = 0.5 * (low + high)
        if MU * (c * c - 1) + LAMBDA * log(known * c**n) > 0:
            high = c
        else:
            low = c
    return c


def stress(c, stretches):
    """First Piola stress along a direction of elastic stretch c."""
    j = stretches[0] * stretches[1] * stretches[2]
    return (MU * (c - 1 / c) + LAMBDA * log(j) / c) / THETA


def energy(stretches):
    j = stretches[0] * stretches[1] * stretches[2]
    return MU / 2 * (sum(c * c for c in stretches) - 3 - 2 * log(j)) + LAMBDA / 2 * log(j) ** 2


def head(title, body, extra):
    return f"""# yaml-language-server: $schema=../../deck.schema.json
title: "{title}"
# Written by write_decks.py, which computes the references.
parameters:
  dx: 1 mm
  a: {ALPHA:g}
  dT: {DT:g}
  theta: 1 + a*dT
  n: {extra['n']}
{extra['parameters']}{body}
temperature: {{field: "300 + dT*t", reference: 300}}
"""


def expectations(stretch, elastic, dims, p_xx, w, at):
    out = []
    for k in range(dims):
        axis = "xyz"[k]
        out.append(f"      - {{name: error of u_{axis}, error: {{field: displacement.{axis}, against: \"{stretch[k] - 1!r}*{axis}\", norm: max}}, value: 0, absolute: 1.0e-15, source: affine}}")
    j = 1.0
    for k in range(dims):
        j *= stretch[k]
    sigma = p_xx * stretch[0] / j
    out.append(f"      - {{field: stress.xx, at: {at}, value: {sigma!r}, absolute: {1e-11 * E:.3e}, source: closed form}}")
    out.append(f"      - {{field: energy_density, at: {at}, value: {w!r}, absolute: {1e-13 * E:.3e}, source: closed form}}")
    return "\n".join(out)


def run(name, settings, text):
    return f"  {name}:\n{settings}    expect:\n{text}\n"


def solid():
    t = THETA
    at = "[n*dx/2 + dx/2, n*dx/2 + dx/2, n*dx/2 + dx/2]"
    body = """body:
  dimension: 3
  points:
    - box: {from: [0, 0, 0], to: [n*dx, n*dx, n*dx], spacing: dx}
  horizon: 2.015*dx
sets:
  inside: {where: "min(min(x, y), z) > 4.1*dx && max(max(x, y), z) < (n - 4.1)*dx"}
  layer: {not: inside}
  origin: {nearest: [0, 0, 0]}
materials:
  metal:
    model: {correspondence: {law: {neo_hookean: {youngs_modulus: 200 GPa, poisson_ratio: 0.3, thermal_expansion: a}}, control: wan_2019_objective}}
conditions: ${how}
solver:
  statics: {tolerance: 1e-12}
output:
  frames: 1
  fields: [displacement, stress, energy_density]
"""
    free = """  free:
    - symmetry: {normal: x}
    - symmetry: {normal: y}
    - symmetry: {normal: z}
    - displacement: {set: origin, x: "(theta - 1)*x*t", y: "(theta - 1)*y*t", z: "(theta - 1)*z*t"}
  held:
    - displacement: {set: layer, name: layer, x: "(sx - 1)*x*t", y: "(sy - 1)*y*t", z: "(sy - 1)*z*t"}
  sx: 1
  sy: 1
  how: ${held}
"""
    out = head("Neo-Hookean solid, heated", body, {"n": 12, "parameters": free}) + "runs:\n"
    c = (1.0, 1.0, 1.0)
    out += run("free", "    set:\n      how: ${free}\n", expectations((t, t, t), c, 3, stress(1.0, c), energy(c), at))
    c = (1 / t, 1 / t, 1 / t)
    out += run("restrained", "", expectations((1, 1, 1), c, 3, stress(1 / t, c), energy(c), at))
    b = free_stretch(1 / t, 2)
    c = (1 / t, b, b)
    out += run("between-walls", f"    set: {{sy: {b * t!r}}}\n", expectations((1, b * t, b * t), c, 3, stress(1 / t, c), energy(c), at))
    return out


def plane():
    t = THETA
    at = "[n*dx/2 + dx/2, n*dx/2 + dx/2]"
    body = """body:
  dimension: 2
  plane: ${plane}
  thickness: 1 mm
  points:
    - rectangle: {from: [0, 0], to: [n*dx, n*dx], spacing: dx}
  horizon: 3.015*dx
sets:
  inside: {where: "min(x, y) > 6.1*dx && max(x, y) < (n - 6.1)*dx"}
  layer: {not: inside}
  origin: {nearest: [0, 0]}
materials:
  metal:
    model: {correspondence: {law: {neo_hookean: {youngs_modulus: 200 GPa, poisson_ratio: 0.3, thermal_expansion: a}}, control: wan_2019_objective}}
conditions: ${how}
solver:
  statics: {method: direct, tolerance: 1e-12}
output:
  frames: 1
  fields: [displacement, stress, energy_density]
"""
    extra = """  free:
    - symmetry: {normal: x}
    - symmetry: {normal: y}
    - displacement: {set: origin, x: "(s - 1)*x*t", y: "(s - 1)*y*t"}
  held:
    - displacement: {set: layer, name: layer, x: "(sx - 1)*x*t", y: "(sy - 1)*y*t"}
  s: theta
  sx: 1
  sy: 1
  plane: stress
  how: ${held}
"""
    out = head("Neo-Hookean plate, heated", body, {"n": 20, "parameters": extra}) + "runs:\n"
    c = (1.0, 1.0, 1.0)
    out += run("free-stress", "    set:\n      how: ${free}\n", expectations((t, t), c, 2, stress(1.0, c), energy(c), at))
    # plane strain: the third direction cannot expand
    b = free_stretch(1 / t, 2)
    c = (b, b, 1 / t)
    out += run("free-strain", f"    set:\n      how: ${{free}}\n      plane: strain\n      s: {b * t!r}\n", expectations((b * t, b * t), c, 2, stress(b, c), energy(c), at))
    b = free_stretch(1 / t**2, 1)
    c = (1 / t, 1 / t, b)
    out += run("restrained-stress", "", expectations((1, 1), c, 2, stress(1 / t, c), energy(c), at))
    c = (1 / t, 1 / t, 1 / t)
    out += run("restrained-strain", "    set: {plane: strain}\n", expectations((1, 1), c, 2, stress(1 / t, c), energy(c), at))
    b = free_stretch(1 / t, 2)
    c = (1 / t, b, b)
    out += run("between-walls-stress", f"    set: {{sy: {b * t!r}}}\n", expectations((1, b * t), c, 2, stress(1 / t, c), energy(c), at))
    return out


if __name__ == "__main__":
    open("solid.yaml", "w").write(solid())
    open("plane.yaml", "w").write(plane())
