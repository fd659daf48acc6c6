"""Whose something is, and its colour: the one table that figures, the page and the live view take by name."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """Whose an ellipsoid, a line or an arm is, and how it looks.

    Attributes
    ----------
    name : str
    color, dark, pale : str
        On light ground, on dark ground, and for crowds of dots behind lines.
    about : str
        What a legend says.
    """

    name: str
    color: str
    dark: str
    pale: str
    about: str

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The colour on light ground as three numbers from 0 to 255."""
        red, green, blue = bytes.fromhex(self.color[1:])
        return red, green, blue


PERSON = Role("person", "#0072B2", "#56B4E9", "#8FC1E3", "the person's ellipsoid")
TARGET = Role("target", "#D55E00", "#F28B42", "#F3B48B", "target: what the robot is asked for (shell)")
ACHIEVED = Role("achieved", "#00805D", "#2FC596", "#8CD3BE", "what the robot achieves")
REFERENCE = Role("reference", "#000000", "#E8EDF2", "#999999", "reference (dashed)")

ROLES = {role.name: role for role in (PERSON, TARGET, ACHIEVED, REFERENCE)}
"""By name. Okabe & Ito's blue, vermilion and green (darker, to be read), which the colour-blind can tell apart."""

OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito's other colours, for what belongs to nobody."""

OTHERS_PALE = ("#E6BFD5", "#F2D08A", "#B5DDF5", "#999999")
