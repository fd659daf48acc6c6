"""Many recordings on many robots: in processes or on a cluster, going on where it was, with a table of all measures.

The names are loaded on first use.
"""

from maniport.util.lazy_names import names_of_stub

__all__, __getattr__ = names_of_stub(__name__, __file__)
