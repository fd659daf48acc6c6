"""Motions of robots: feasible ellipsoids, placement of paths, planning, time parameterization and control.

Targets are in the arm's base frame.

The names are loaded on first use.
"""

from maniport.util.lazy_names import names_of_stub

__all__, __getattr__ = names_of_stub(__name__, __file__)
