"""How long a person's arm is, from the body height alone.

=========  ========  ==============================================================================================
segment    fraction  from
=========  ========  ==============================================================================================
upper arm  0.1618    281.7 mm of 1741 mm, centre of the shoulder to that of the elbow: de Leva (1996), men
forearm    0.1545    268.9 mm of 1741 mm, centre of the elbow to that of the wrist: de Leva (1996), men
hand       0.0343    0.108, wrist to tip of the middle finger (Drillis and Contini 1966; in Winter, Biomechanics and
                     Motor Control of Human Movement, figure 4.1), × 0.318: in MyoSim's hand the middle of the third
                     metacarpal is 55.3 mm from the wrist, the tip of the middle finger 174.1 mm
=========  ========  ==============================================================================================

De Leva's lengths run between centres of joints, as those of the models do. Drillis and Contini's upper arm (0.186) and
forearm (0.146) are measured otherwise: at 1.75 m they give 0.326 m and 0.256 m, where the models have 0.291 and 0.258
(MyoArm) or 0.302 and 0.280 m (rHuMan) and these fractions 0.283 and 0.270 m.

References
----------
P. de Leva, Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters, Journal of Biomechanics 29 (1996).
R. Drillis, R. Contini, Body segment parameters, technical report 1166.03, New York University (1966).
"""

from maniport.validation import as_number

FRACTIONS = {"upper arm": 0.2817 / 1.741, "forearm": 0.2689 / 1.741, "hand": 0.108 * 0.0553 / 0.1741}
"""Length of each segment as a fraction of the body height."""

HEIGHTS = (1.0, 2.5)
"""Body heights that are taken [m]."""

ADULTS = (1.4, 2.1)
"""Body heights of nearly all adults [m]."""

VARIATION = 0.15
"""By what part a segment may differ from its fraction: people differ, and so do the points taken for a joint."""


def as_height(value: float | None) -> float | None:
    """Check a body height [m]; None stays None."""
    low, high = HEIGHTS
    return None if value is None else as_number(value, "height [m]", minimum=low, maximum=high)


def segment_length(segment: str, height: float) -> float:
    """Length of a segment [m] of a person so tall [m]."""
    return FRACTIONS[segment] * height


def adult_range(segment: str) -> tuple[float, float]:
    """The shortest and the longest that a segment of an adult is [m]."""
    return (
        (1.0 - VARIATION) * segment_length(segment, ADULTS[0]),
        (1.0 + VARIATION) * segment_length(segment, ADULTS[1]),
    )
