"""Endings of the files of a figure, for those who list files and draw nothing."""

BOTH = (".png", ".svg")
"""What every run writes of a figure: for the screen, and for a paper."""


def files_of(*names: str) -> tuple[str, ...]:
    """Names of the files of figures that are saved without an ending."""
    return tuple(f"{name}{ending}" for name in names for ending in BOTH)
