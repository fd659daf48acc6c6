"""Noise of points, as video keypoints have it: measured, and smoothed by a robust spline where it is large.

Each track x of a point minimizes

    Σ_t w_t |x_t - y_t|² + λ Σ_t |Δ³ x_t|²

(Eilers, Analytical Chemistry 75, 2003, with third differences). The weights w are those of Student's distribution, so
that outliers do not pull the track. λ has the least generalized cross-validation.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import median_filter
from scipy.special import comb

from maniport.errors import InvalidInputError, argument, spoken
from maniport.mocap.recording import Recording, runs_of
from maniport.util.defaults import AUTO
from maniport.util.validation import Array, as_choice, as_number

LARGE_NOISE = 0.004
"""Noise of a point in one direction from which it is smoothed [m]. Optical systems have 0.0001 to 0.001, skeletons of
people who climb and jump 0.002, keypoints of video 0.005 to 0.02."""

LEAST_SHARE = 0.003
"""Smallest cutoff as a share of the frame rate: below it rounding of the equations moves points by millimetres."""

CUTOFFS = np.geomspace(0.8, 12.0, 15)  # Candidate cutoff frequencies, at which half the amplitude is left [Hz]


def noise(track: Array, order: int = 6) -> float:
    """Estimate the standard deviation of a track's noise in one direction [m], shape (n, 3); nan where it cannot.

    Motion up to a seventh of the frame rate hardly shows in differences of sixth order.
    """
    differences = np.abs(np.diff(track, order, axis=0))
    if not np.isfinite(differences).any():
        return float("nan")
    return float(np.nanmedian(differences) / 0.6745 / np.sqrt(comb(2 * order, order)))


def as_smoothing(value: Any) -> float | None:
    """Check the option `smooth`; return the cutoff [Hz], infinite for "off", None for "auto"."""
    if isinstance(value, str):
        try:
            value = float(value)  # as it was typed
        except ValueError:
            return None if as_choice(value, "smooth", (AUTO, "off")) == AUTO else np.inf
    return as_number(value, "smooth [Hz]", above=0.0)


def smoothed(recording: Recording, cutoff: float | None = None) -> Recording:
    """Smooth the noisy points, or all up to a cutoff [Hz]; `quality_warnings` reports noise and smoothing.

    Below 20 frames a second motion cannot be told from noise, and runs of less than 12 frames are kept.
    """
    amounts = np.array([noise(recording.positions[:, i]) for i in range(len(recording.names))])
    least = LEAST_SHARE * recording.rate
    if cutoff is not None and cutoff < least:
        raise InvalidInputError(
            f"{spoken('smooth')} must be at least {least:.3g} Hz for {recording.rate:.4g} frames a second; "
            f"found {cutoff:g}"
        )
    noisy = np.flatnonzero((amounts > LARGE_NOISE) & (recording.rate >= 20.0) & (least <= CUTOFFS[-1]))
    names = ", ".join(recording.names[i] for i in noisy)
    text = f"{names} jitter by {_span(1e3 * amounts[noisy])} mm" if len(noisy) else ""
    if cutoff == np.inf:
        doubt = f"{text}; {argument('smooth', AUTO)} smooths them"
        return replace(recording, quality_warnings=(*recording.quality_warnings, doubt)) if text else recording
    positions, used = recording.positions.copy(), []
    for i in noisy if cutoff is None else range(len(amounts)):
        for start, stop in runs_of(np.isfinite(positions[:, i, 0])):
            if stop - start >= 12:
                positions[start:stop, i], followed = _robust_spline(positions[start:stop, i], recording.rate, cutoff)
                used.append(followed)
    if not used:
        return recording
    how = f"smoothed: motion is followed up to {_span(used)} Hz"
    if cutoff is not None:
        return replace(recording, positions=positions, notes=(*recording.notes, f"{how}, as asked for"))
    doubt = f"{text} and were {how}; {argument('smooth', 'off')} leaves them as they are"
    return replace(recording, positions=positions, quality_warnings=(*recording.quality_warnings, doubt))


def _span(values: Array | list[float]) -> str:
    """Describe a range of values to two digits."""
    low, high = f"{np.nanmin(values):.2g}", f"{np.nanmax(values):.2g}"
    return low if low == high else f"{low} to {high}"


def _robust_spline(track: Array, rate: float, cutoff: float | None) -> tuple[Array, float]:
    """Smooth one run of frames (n, 3); return it with the cutoff [Hz]."""
    cutoffs = [cutoff] if cutoff is not None else [f for f in CUTOFFS if LEAST_SHARE * rate <= f < 0.45 * rate]
    tails = 4.0  # degrees of freedom of Student's distribution
    median_chi_squared = 2.366  # with three degrees of freedom
    weight, least = np.ones(len(track)), max(noise(track) ** 2, 1e-18)
    best = (np.inf, track, float(cutoffs[0]))
    for _ in range(6):
        best = min((_spline(track, weight, f, rate) for f in cutoffs), key=lambda spline: spline[0])
        squares = np.sum((track - best[1]) ** 2, axis=-1)
        # An outlier of a moment counts less; frames where motion is too fast for the spline for longer do not.
        scale = median_filter(squares, 15, mode="nearest") / median_chi_squared
        weight = (tails + 3) / (tails + squares / np.maximum(scale, least))
    return best[1], best[2]


def _spline(track: Array, weight: Array, cutoff: float, rate: float) -> tuple[float, Array, float]:
    """Return generalized cross-validation, smooth track and cutoff."""
    n = len(track)
    strength = (2 * np.sin(np.pi * min(cutoff / rate, 0.5))) ** -6.0  # half the amplitude is left at the cutoff
    matrix = strength * _third_differences(n)
    matrix[0] += weight
    result = solveh_banded(matrix, weight[:, None] * track, lower=True)
    waves = (2 * np.sin(np.pi * (np.arange(n) + 0.5) / (2 * n))) ** 6
    freedom = np.sum(1 / (1 + strength / weight.mean() * waves))
    error = np.sum(weight * np.sum((track - result) ** 2, axis=-1)) / weight.sum()
    return float(error / (1 - freedom / n) ** 2), np.asarray(result), cutoff


def _third_differences(n: int) -> Array:
    """Return the matrix DᵀD of third differences as lower bands, shape (4, n)."""
    pattern = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    for offset in range(4):
        for k in range(4 - offset):
            bands[offset, k : n - 3 + k] += pattern[k] * pattern[k + offset]
    return bands
