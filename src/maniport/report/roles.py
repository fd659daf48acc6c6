"""Roles of ellipsoids, lines and arms, and their colors in figures, on the page and in the live view."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """A role with its colors on a light and on a dark background, and for dots behind lines."""

    name: str
    color: str
    dark: str
    pale: str
    about: str  # text of a legend

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The color on a light background as three numbers from 0 to 255."""
        red, green, blue = bytes.fromhex(self.color[1:])
        return red, green, blue


# Okabe & Ito's blue, vermilion and (darker) green, which remain distinct for color-blind readers
PERSON = Role("person", "#0072B2", "#56B4E9", "#8FC1E3", "human ellipsoid")
TARGET = Role("target", "#D55E00", "#F28B42", "#F3B48B", "target ellipsoid of the robot (shell)")
ACHIEVED = Role("achieved", "#00805D", "#2FC596", "#8CD3BE", "achieved ellipsoid of the robot")
REFERENCE = Role("reference", "#000000", "#E8EDF2", "#999999", "reference (dashed)")

ROLES = {role.name: role for role in (PERSON, TARGET, ACHIEVED, REFERENCE)}

OTHERS = ("#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe & Ito's other colors, for data without a role."""
