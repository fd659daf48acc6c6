"""The panel of the page: controls and numbers."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.util.validation import Array
from maniport.viewer.access_control import AccessControl, Control
from maniport.viewer.numbers import headlines, method_table, readable
from maniport.viewer.shapes import from_roll_pitch_yaw, roll_pitch_yaw
from maniport.viewer.state import Command, Frame, ViewState

STEP = 0.5  # Of the sliders of angles [degrees]
RECORDING, SLIDERS = "recording", "sliders"
BASE_ORIENTATIONS = {
    "as the person": (0.0, 0.0, 0.0),
    "facing the person": (0.0, 0.0, 180.0),
    "on a wall": (0.0, -90.0, 0.0),
    "from the ceiling": (180.0, 0.0, 0.0),
    "at the person's right side": (-90.0, 0.0, 0.0),
}
"""Usual base orientations by name: roll, pitch and yaw from the person's trunk frame to the base frame [degrees]."""
OWN = "own"


class Panel:
    """Controls and numbers; the loop reads the controls, which call nothing."""

    def __init__(self, gui: Any, state: ViewState, method: str, base_rotation: Array, access: AccessControl):
        self._state, self._base_rotation, self._access = state, base_rotation, access
        self._jump, player = threading.Event(), state.playback
        several = len(state.sides) > 1
        self._names = [f"{side.teacher.side}: " if several else "" for side in state.sides]
        moved = "The recording moves" if player is not None else "Move the sliders of"
        gui.add_markdown(f"{moved} the person's arm; the robot follows. Drag to rotate the view.")
        self._head = gui.add_html("")
        methods = gui.add_dropdown("Method", state.methods, initial_value=method, hint="Map of ellipsoids to the robot")
        self._method = Control(methods, access, state.methods)
        follows = gui.add_checkbox(
            "End effector follows", player is not None,
            hint="The robot's end effector follows the person's hand; the ellipsoid has lower priority",
        )  # fmt: skip
        self._follows = Control(follows, access)
        jump = gui.add_button("Find a better configuration", hint="The robot jumps to the best configuration found")
        jump.on_click(lambda _: self._jump.set())
        if player is not None:
            self._add_player(gui, player.duration)
        self._folders, self._sliders = [], list[Control]()
        for side in state.sides:
            name = f"{side.teacher.side} " if several else ""
            self._folders.append(gui.add_folder(f"Person's {name}joints [°]", visible=player is None))
            with self._folders[-1]:
                self._sliders += [self._joint_slider(gui, side.teacher, i) for i in range(side.teacher.dof)]
        self._add_base(gui, base_rotation)
        with gui.add_folder("Methods", expand_by_default=False):
            self._methods = gui.add_markdown("")

    def read(self, seconds: float) -> Command:
        """Return the values of the controls, `seconds` after the last time."""
        if self._jump.is_set():
            self._jump.clear()
            self._state.jump()
        return Command(self._joints(seconds), self._method.value, self._base(), self._follows.value)

    def write(self, frames: Sequence[Frame]) -> None:
        """Write the numbers of the frame of each arm."""
        self._head.content = headlines(frames, self._names)
        self._methods.content = method_table(frames, self._state, self._method.value, self._names)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._written_time = round(player.position, 2)
            self._time.value = self._written_time

    def _slider(self, gui: Any, name: str, low: float, high: float, step: float, value: float) -> Control:
        return Control(gui.add_slider(name, low, high, step, value), self._access, low=low, high=high)

    def _joint_slider(self, gui: Any, arm: Any, i: int) -> Control:
        """Add a slider; shoulder and elbow are bent at first, where the arm is far from singular."""
        bent = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}
        low, high = (round(float(angle), 3) for angle in np.degrees([arm.lower[i], arm.upper[i]]))
        start = float(np.clip(bent.get(arm.joint_names[i], 0.0), low, high))
        name = readable(arm.joint_names[i]).replace("elv", "elevation")
        return self._slider(gui, name, low, high, STEP, start)

    def _add_player(self, gui: Any, duration: float) -> None:
        names, last = (RECORDING, SLIDERS), float(np.ceil(100 * duration) / 100)
        self._source = Control(gui.add_dropdown("Person moved by", names), self._access, names)
        self._player = gui.add_folder("Recording")
        with self._player:
            self._plays = Control(gui.add_checkbox("Play", True), self._access)
            self._time = self._slider(gui, "Time [s]", 0.0, last, 0.01, 0.0)
            self._speed = self._slider(gui, "Speed", 0.1, 2.0, 0.1, 1.0)
        self._written_time = 0.0

    def _add_base(self, gui: Any, base_rotation: Array) -> None:
        angles, names = _rounded(roll_pitch_yaw(base_rotation)), (*BASE_ORIENTATIONS, OWN)
        presets = gui.add_dropdown("Base orientation", names, initial_value=_preset_of(angles))
        self._preset = Control(presets, self._access, names)
        self._chosen = self._preset.value
        with gui.add_folder("Base orientation [°]", expand_by_default=False):
            self._angles = [
                self._slider(gui, name, -180.0, 180.0, STEP, angle)
                for name, angle in zip(("roll", "pitch", "yaw"), angles.tolist(), strict=True)
            ]
        self._written = angles

    def _joints(self, seconds: float) -> Array:
        player = self._state.playback
        if player is not None and self._source.value == RECORDING:
            self._show_sliders(False)
            if self._time.value != self._written_time:  # the slider was moved
                self._written_time = self._time.value
                player.seek(self._written_time)
            elif self._plays.value:
                player.advance(self._speed.value * seconds)
            return player.joints()
        if player is not None:
            self._show_sliders(True)
        return np.radians([slider.value for slider in self._sliders])

    def _show_sliders(self, visible: bool) -> None:
        if self._folders[0].visible == visible:
            return
        if visible and self._state.playback is not None:  # continue from the recording
            for slider, angle in zip(self._sliders, np.degrees(self._state.playback.joints()), strict=True):
                slider.value = float(angle)
        self._player.visible = not visible
        for folder in self._folders:
            folder.visible = visible

    def _base(self) -> Array:
        """Return the base orientation of the list or of the sliders, whichever was changed."""
        angles, preset = np.array([slider.value for slider in self._angles]), self._preset.value
        if preset != self._chosen:
            self._chosen = preset
            if preset != OWN:
                angles = np.array(BASE_ORIENTATIONS[preset])
                for slider, angle in zip(self._angles, angles.tolist(), strict=True):
                    slider.value = angle
                self._base_rotation, self._written = from_roll_pitch_yaw(angles), angles
        elif not np.array_equal(angles, self._written):
            self._base_rotation, self._written = from_roll_pitch_yaw(angles), angles
            self._chosen = self._preset.value = _preset_of(angles)
        return self._base_rotation


def _preset_of(angles: Array) -> str:
    """Return the name of a base orientation in `BASE_ORIENTATIONS`, or `OWN`."""
    rotation = from_roll_pitch_yaw(angles)
    named = ((name, from_roll_pitch_yaw(np.array(one))) for name, one in BASE_ORIENTATIONS.items())
    return next((name for name, one in named if np.allclose(one, rotation, atol=1e-6)), OWN)


def _rounded(angles: Array) -> Array:
    return np.round(np.asarray(angles) / STEP) * STEP + 0.0
