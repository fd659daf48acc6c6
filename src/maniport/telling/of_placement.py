"""Facts of what is searched before a motion: where a path lies, what a robot can make, where searches start."""

from dataclasses import replace

import numpy as np

from maniport.telling.facts import Fact, Facts, Section, Table, listed, numbers, spread, told, warning
from maniport.telling.of_motion import DISTANCE, FLOOR, FLOOR_MEANING
from maniport.tracking import FeasibleEllipsoids, PlacedPath, StartBank
from maniport.validation import Array

RANKING = (
    "Places by the motions that were planned through some points of the path there, the best first; of places that are "
    "as good the first turns the path least. It is taken unless another rank is asked for."
)


@told.register
def placement_facts(placed: PlacedPath) -> Facts:
    """Tell where a hand path was placed before a robot."""
    section = replace(placement_section(placed), tables=(_ranking(placed),) if placed.candidates else ())
    return Facts(f"A path of {len(placed.path)} points", "", (section,))


def _ranking(placed: PlacedPath) -> Table:
    """Tell where else the path could lie."""
    rows, values = [], []
    for rank, one in enumerate(placed.candidates, 1):
        yaw, tilt, heading = (float(np.degrees(angle)) for angle in (one.yaw, one.tilt, one.heading))
        median, p95, largest = (float(value) for value in np.percentile(one.distance, [50.0, 95.0, 100.0]))
        middle = ", ".join(f"{value:.3f}" for value in one.offset)
        lean = f"{tilt:.1f} to {heading:.1f}" if tilt else "0"
        near = f"{median:.2f} / {p95:.2f} / {largest:.2f}"
        rows.append((str(rank), f"{one.scale:.3f}", f"{yaw:.1f}", lean, middle, near, f"{one.rms:.2f}"))
        values.append({"rank": rank, "scale": one.scale, "yaw_deg": yaw, "tilt_deg": tilt, "heading_deg": heading,
                       "offset_m": one.offset.tolist(),
                       "distance": {"median": median, "p95": p95, "max": largest, "rms": one.rms}})  # fmt: skip
    columns = ("rank", "scale", "yaw [°]", "tilt [°]", "middle [m]", "distance, median / 95 % / largest", "rms")
    return Table(columns, tuple(rows), RANKING, "candidates", values)


def placement_section(placed: PlacedPath, time: Array | None = None) -> Section:
    """Tell where a path lies, whether the robot reaches it, and how near each point of it could come by itself."""
    yaw, tilt, heading = (float(np.degrees(angle)) for angle in (placed.yaw, placed.tilt, placed.heading))
    offset = placed.offset.tolist()
    out = int((~placed.reachable).sum())
    far = 1e3 * float(placed.position_error.max()) if out else 0.0
    facts = (
        *([warning("path-out-of-reach",
                   f"{out} of {len(placed.path)} points of the path are out of reach, by up to {far:.1f} mm")]
          if out else []),
        Fact("Path", f"{placed.scale:.3f} times as large, turned by {yaw:.1f}° about the vertical, its middle at "
             f"({listed([f'{value:.3f}' for value in offset])}) m",
             "Size, turn and middle: where the robot can follow best. The target ellipsoids turned with it."),
        Fact("Base", f"leans by {tilt:.1f}° towards {heading:.1f}° from its x axis to its y axis" if tilt else "",
             "How to mount it: its upright position turned about a horizontal axis. Path and middle are in its frame.",
             key="mount", value={"tilt_deg": tilt, "heading_deg": heading, "rotation": placed.mount.tolist()}),
        spread(FLOOR, "node_floor", placed.distance, time, meaning=FLOOR_MEANING, role="reference"),
        *numbers(scale=float(placed.scale), yaw_deg=yaw, offset_m=offset, points_out_of_reach=out,
                 farthest_out_of_reach_mm=far),
    )  # fmt: skip
    return Section("Where the path lies", facts, key="placement")


@told.register
def feasible_facts(found: FeasibleEllipsoids) -> Facts:
    """Tell how near an arm can come to target ellipsoids, each by itself."""
    count, d = found.ellipsoids.shape[:2]
    facts = [spread("Distance", "distance", found.distance, meaning=DISTANCE, role="achieved")]
    if found.position_error is not None:
        away = 1e3 * found.position_error
        facts.append(spread("Tip beside its place", "tip_error", away, unit="mm", role="achieved"))
    return Facts(f"{count} ellipsoids of {d} × {d}", "", (Section("", tuple(facts)),))


@told.register
def bank_facts(bank: StartBank) -> Facts:
    """Tell what a start bank holds."""
    low, high = bank.tip_positions.min(axis=0), bank.tip_positions.max(axis=0)
    spans = [f"{axis} {a:.2f} to {b:.2f} m" for axis, a, b in zip("xyz", low, high, strict=True)]
    weights = bank.spec.joint_weights
    facts = (
        Fact("Arm", bank._arm_name),
        Fact("Samples", str(len(bank)), key="samples", value=len(bank)),
        Fact("Ellipsoids", str(bank.spec)),
        Fact("Joint weights", "" if weights is None else str(weights)),
        Fact("Damping", f"{bank.damping.epsilon:.3g}", key="damping", value=bank.damping.epsilon),
        Fact("Tip", listed(spans)),
    )
    return Facts("", "", (Section("", facts),))
