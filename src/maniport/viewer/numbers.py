"""Numbers of the panel: the distance of each arm, and a table of the methods."""

from collections.abc import Sequence

from maniport.evaluation.baselines import LOOKUP
from maniport.report.metrics import in_axes
from maniport.report.roles import ACHIEVED, PERSON, TARGET
from maniport.viewer.state import Frame, ViewState

LEGEND = "".join(
    f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'
    for role in (PERSON, TARGET, ACHIEVED)
)
"""Colors of the ellipsoids."""


def readable(name: str) -> str:
    """Write the name of a joint or a method in words."""
    words = {"elv": "elevation", "rot": "rotation", "pro": "pronation", "sup": "supination"}
    return " ".join(words.get(word, word) for word in name.replace("_", " ").replace("-", " ").split())


def headlines(frames: Sequence[Frame], names: Sequence[str]) -> str:
    """Write the distance of each arm, its position error and its saturated joints, and the legend."""
    lines = []
    for name, frame in zip(names, frames, strict=True):
        error = "" if frame.position_error is None else f"; position error {1e3 * frame.position_error:.1f} mm"
        joints = ", ".join(map(readable, frame.at_limit))
        lines += [
            f'<div style="font-size: 2.2em; line-height: 1.1">{frame.distance:.2f}</div>',
            f"<div>{name}ellipsoid distance: {in_axes(frame.distance)}{error}</div>",
            f'<div style="font-weight: bold">saturated: {joints}</div>' if joints else "",
        ]
    return f'<div style="padding: 0 0.6em">{"".join(lines)}<div>{LEGEND}</div></div>'


def method_table(frames: Sequence[Frame], state: ViewState, method: str, names: Sequence[str]) -> str:
    """Write the feasibility gap of each method's target for each arm, and notes about fits and targets."""
    maps = [side.refitting.maps for side in state.sides]
    gaps = [side.gaps(frame.demonstrated_ellipsoid) for side, frame in zip(state.sides, frames, strict=True)]
    head = " | ".join(f"{name}feasibility gap" for name in names)
    rows = [f"| method | {head} |", "|---" * (len(maps) + 1) + "|"]
    for one in state.methods:
        label = f"**{readable(one)}**" if one == method else readable(one)
        cells = []
        for own, found in zip(maps, gaps, strict=True):
            gap = None if one == LOOKUP else found.get(one)  # samples of the robot have no gap by construction
            cells.append("fitting …" if one not in own else "—" if gap is None else f"{gap:.2f}")
        rows.append(f"| {label} | {' | '.join(cells)} |")
    notes = []
    for name, own, frame in zip(names, maps, frames, strict=True):
        texts = own[method].notes if method in own else ()
        notes += [f"*{name}{note}*\n" for note in (*texts, frame.note) if note]
    meaning = "Feasibility gap: distance from the target to the nearest feasible ellipsoid found."
    return "\n".join([*rows, "", meaning, "", *notes])
