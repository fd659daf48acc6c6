"""Sections and tables of placements; not in `robots`, since a robot alone has none."""

from collections.abc import Sequence

import numpy as np

from maniport.motion import Placement
from maniport.report.values import Section, Table, listed

PLACEMENT_COLUMNS = {
    "rank": "{rank}",
    "scale": "{scale:.3f}",
    "yaw [°]": "{yaw_deg:.1f}",
    "tilt [°]": "{tilt_deg:.1f} to {heading_deg:.1f}",
    "middle [m]": "{offset_m[0]:.3f}, {offset_m[1]:.3f}, {offset_m[2]:.3f}",
    "distance, rms / max": "{rms:.2f} / {max:.2f}",
}
"""Format strings of the columns of the table of placements."""


def placement_section(placed: Placement) -> Section:
    """Describe the placement of a path, and whether the robot reaches it."""
    section = Section("Placement", key="placement", folded=True)
    yaw = float(np.degrees(placed.yaw))
    tilt = float(np.degrees(placed.tilt))
    heading = float(np.degrees(placed.heading))
    offset = placed.offset.tolist()
    unreachable = int((~placed.reachable).sum())
    farthest = 0.0
    if unreachable:
        farthest = 1e3 * float(placed.position_error.max())  # [mm]
        points = f"{unreachable} of {len(placed.position_error)} waypoints of the path"
        section.warn("path-out-of-reach", f"{points} are out of reach, by up to {farthest:.1f} mm")

    middle = listed(f"{value:.3f}" for value in offset)
    text = f"scale {placed.scale:.3f}, yaw {yaw:.1f}°, middle at ({middle}) m in the base frame"
    section.add("Path", "", None, text, "The target ellipsoids are rotated with the path.")
    base = {"tilt_deg": tilt, "heading_deg": heading, "rotation": placed.base_orientation.tolist()}
    text = ""
    if tilt:
        text = f"tilted by {tilt:.1f}° toward {heading:.1f}° from its x axis to its y axis"
    about = "Rotation from the upright base about a horizontal axis."
    section.add("Base", "base_orientation", base, text, about)
    section.numbers(
        scale=float(placed.scale),
        yaw_deg=yaw,
        offset_m=offset,
        points_out_of_reach=unreachable,
        farthest_out_of_reach_mm=farthest,
    )
    return section


def placements_table(placements: Sequence[Placement]) -> Table:
    """Return a table of placements from the best to the worst."""
    records = []
    for rank, candidate in enumerate(placements, 1):
        record = {
            "rank": rank,
            "scale": candidate.scale,
            "yaw_deg": float(np.degrees(candidate.yaw)),
            "offset_m": candidate.offset.tolist(),
            "tilt_deg": float(np.degrees(candidate.tilt)),
            "heading_deg": float(np.degrees(candidate.heading)),
            "rms": candidate.rms,
            "max": float(candidate.distance.max()),
        }
        records.append(record)
    caption = "Placements by the distances of trajectories through some waypoints, the best first."
    return Table.of(records, PLACEMENT_COLUMNS, caption, "candidates")
