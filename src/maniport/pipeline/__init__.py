"""The main job: a recording in, the motion of a robot out; before it, several demonstrations become one.

The names are loaded on first use, since the command line needs the configuration alone.
"""

from maniport.util.lazy_names import names_of_stub

__all__, __getattr__ = names_of_stub(__name__, __file__)
