"""From a recording of a person to the joint angles of an arm.

The names are loaded on first use.
"""

from maniport.util.lazy_names import names_of_stub

__all__, __getattr__ = names_of_stub(__name__, __file__)
