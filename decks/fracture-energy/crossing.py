"""Bonds that a straight crack between two rows of a square lattice breaks per spacing of advance."""
import itertools
import sys

ratio = float(sys.argv[1]) if len(sys.argv) > 1 else 4.015
reach = int(ratio)
print(sum(j for i, j in itertools.product(range(-reach, reach + 1), repeat=2) if j > 0 and i * i + j * j <= ratio * ratio))
