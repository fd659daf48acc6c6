"""The panel of the page: controls, and the distance of each arm."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.report.page.content import ACHIEVED, PERSON, TARGET
from maniport.report.values import in_axes
from maniport.util.validation import Array
from maniport.viewer.state import Command, Frame, ViewState

BASE_ORIENTATIONS = {
    "as the person": (0.0, 0.0, 0.0),
    "facing the person": (0.0, 0.0, 180.0),
    "on a wall": (0.0, -90.0, 0.0),
    "from the ceiling": (180.0, 0.0, 0.0),
    "at the person's right side": (-90.0, 0.0, 0.0),
}
"""Usual base orientations by name: roll, pitch and yaw from the person's trunk frame to the base frame [degrees]."""

LEGEND = "".join(
    f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'
    for role in (PERSON, TARGET, ACHIEVED)
)
"""Colors of the ellipsoids."""


class Panel:
    """Controls and numbers; the loop reads the controls, which call nothing."""

    def __init__(self, gui: Any, state: ViewState, method: str, base_rotation: Array):
        self._state, self._jump = state, threading.Event()
        player, several = state.playback, len(state.sides) > 1
        self._names = [f"{side.teacher.side}: " if several else "" for side in state.sides]
        moved = "The recording moves" if player is not None else "Move the sliders of"
        gui.add_markdown(f"{moved} the person's arm; the robot follows. Drag to rotate the view.")
        self._head = gui.add_html("")
        self._method = gui.add_dropdown("Method", state.methods, initial_value=method)
        self._follows = gui.add_checkbox("End effector follows", player is not None)
        jump = gui.add_button("Find a better configuration", hint="The robot jumps to the best configuration found")
        jump.on_click(lambda _: self._jump.set())
        self._sliders: list[Any] = []
        if player is not None:
            self._plays, self._written_time = gui.add_checkbox("Play", True), 0.0
            self._time = gui.add_slider("Time [s]", 0.0, float(np.ceil(100 * player.duration) / 100), 0.01, 0.0)
            self._speed = gui.add_slider("Speed", 0.1, 2.0, 0.1, 1.0)
        else:
            bent = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}  # at first, far from singular
            for side in state.sides:
                arm, name = side.teacher, f"{side.teacher.side} " if several else ""
                with gui.add_folder(f"Person's {name}joints [°]"):
                    for joint, *limits in zip(
                        arm.joint_names, np.degrees(arm.lower), np.degrees(arm.upper), strict=True
                    ):
                        low, high = (round(float(angle), 3) for angle in limits)
                        start = float(np.clip(bent.get(joint, 0.0), low, high))
                        self._sliders.append(gui.add_slider(readable(joint), low, high, 0.5, start))
        named = {name: Rotation.from_euler("xyz", angles, degrees=True) for name, angles in BASE_ORIENTATIONS.items()}
        rotations = {name: np.asarray(rotation.as_matrix()) for name, rotation in named.items()}
        preset = next((name for name, own in rotations.items() if np.allclose(own, base_rotation, atol=1e-6)), "own")
        self._rotations = rotations | {preset: base_rotation}
        self._preset = gui.add_dropdown("Base orientation", tuple(self._rotations), initial_value=preset)
        self._notes = gui.add_markdown("")

    def read(self, seconds: float) -> Command:
        """Return the values of the controls, `seconds` after the last time."""
        if self._jump.is_set():
            self._jump.clear()
            self._state.jump()
        player = self._state.playback
        if player is None:
            joints = np.radians([slider.value for slider in self._sliders])
        else:
            if self._time.value != self._written_time:  # the slider was moved
                self._written_time = self._time.value
                player.seek(self._written_time)
            elif self._plays.value:
                player.advance(self._speed.value * seconds)
            joints = player.joints()
        return Command(joints, self._method.value, self._rotations[self._preset.value], self._follows.value)

    def write(self, frames: Sequence[Frame]) -> None:
        """Write the numbers of the frame of each arm."""
        lines, notes = [], []
        for name, frame in zip(self._names, frames, strict=True):
            error = "" if frame.position_error is None else f"; position error {1e3 * frame.position_error:.1f} mm"
            joints = ", ".join(map(readable, frame.at_limit))
            lines += [
                f'<div style="font-size: 2.2em; line-height: 1.1">{frame.distance:.2f}</div>',
                f"<div>{name}ellipsoid distance: {in_axes(frame.distance)}{error}</div>",
                f'<div style="font-weight: bold">saturated: {joints}</div>' if joints else "",
            ]
            notes += [f"*{name}{note}*\n" for note in frame.target.notes]
        self._head.content = f'<div style="padding: 0 0.6em">{"".join(lines)}<div>{LEGEND}</div></div>'
        self._notes.content = "\n".join(notes)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._time.value = self._written_time = round(player.position, 2)


def readable(name: str) -> str:
    """Write the name of a joint or a method in words."""
    words = {"elv": "elevation", "rot": "rotation", "pro": "pronation", "sup": "supination"}
    return " ".join(words.get(word, word) for word in name.replace("_", " ").replace("-", " ").split())
