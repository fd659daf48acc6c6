"""The panel of the page: controls and numbers."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.util.validation import Array
from maniport.viewer.access_control import AccessControl, Control
from maniport.viewer.numbers import History, ellipsoid_table, headlines, method_table
from maniport.viewer.shapes import from_roll_pitch_yaw, quaternion, roll_pitch_yaw, rotation_of
from maniport.viewer.state import Command, Frame, ViewState

STEP = 0.5  # Of the sliders of angles [degrees]
RECORDING = "recording"
SLIDERS = "sliders"
MOUNTINGS = {
    "as the person": (0.0, 0.0, 0.0),
    "facing the person": (0.0, 0.0, 180.0),
    "on a wall": (0.0, -90.0, 0.0),
    "from the ceiling": (180.0, 0.0, 0.0),
    "at the person's right side": (-90.0, 0.0, 0.0),
}
"""Usual mountings by name: roll, pitch and yaw from the person's trunk frame to the robot's base frame [degrees]."""
OWN = "own"


class Panel:
    """The controls and numbers; the loop reads the controls, which call nothing."""

    def __init__(
        self, gui: Any, state: ViewState, method: str, base_rotation: Array, access: AccessControl, no_surface: str = ""
    ):
        self._state, self._mounting, self._access = state, base_rotation, access
        self._jump, self._histories = threading.Event(), [History() for _ in state.sides]
        self.gizmo: Any = None
        alone, player = len(state.sides) == 1, state.playback
        self._head = gui.add_html("")
        methods = gui.add_dropdown("Method", state.methods, initial_value=method, hint="Maps ellipsoids to the robot")
        self._method = Control(methods, access, state.methods)
        follows = gui.add_checkbox(
            "End effector follows", player is not None,
            hint="The robot's end effector follows the person's hand, at the expense of the ellipsoid",
        )  # fmt: skip
        self._follows = Control(follows, access)
        jump = gui.add_button("Find a better configuration", hint="The robot jumps to the best configuration found")
        jump.on_click(lambda _: self._jump.set())
        if player is not None:
            self._add_player(gui, player.duration)
        self._folders, self._sliders = [], list[Control]()
        for side in state.sides:
            name = "" if alone else f"{side.teacher.side} "
            self._folders.append(gui.add_folder(f"Person's {name}joints [°]", visible=player is None))
            with self._folders[-1]:
                self._sliders += [self._joint_slider(gui, side.teacher, i) for i in range(side.teacher.dof)]
        self._add_mounting(gui, base_rotation)
        hint = "Switched off, it is written to the working directory" if alone else "One arm at a time: --side left"
        self._record = Control(gui.add_checkbox("Record what I play", False, disabled=not alone, hint=hint), access)
        self._message = gui.add_markdown("", visible=False)
        with gui.add_folder("Compare the methods", expand_by_default=False):
            self._methods = gui.add_markdown("")
        with gui.add_folder("Ellipsoids and surface", expand_by_default=False):
            self._ellipsoids = gui.add_markdown("")
            hint = no_surface or "Or its skeleton, to look inside"
            surface = gui.add_checkbox("Robot's surface", not no_surface, disabled=bool(no_surface), hint=hint)
            self._surface = Control(surface, access)

    @property
    def surface(self) -> bool:
        """Whether the robot is shown with its surface."""
        return bool(self._surface.value)

    @property
    def records(self) -> bool:
        """Whether the motion shall be recorded."""
        return len(self._state.sides) == 1 and bool(self._record.value)

    def read(self, seconds: float) -> Command:
        """The values of the controls, `seconds` after the last time."""
        if self._jump.is_set():
            self._jump.clear()
            self._state.jump()
        return Command(self._joints(seconds), self._method.value, self._turned(), self._follows.value)

    def note(self, frames: Sequence[Frame], seconds: float) -> None:
        """Remember the distances of frames, some time after the last ones [s]."""
        for history, frame in zip(self._histories, frames, strict=True):
            history.add(seconds, frame.distance)

    def report(self, message: str) -> None:
        """Show a message about a recording."""
        self._message.content, self._message.visible = message, True

    def write(self, frames: Sequence[Frame], rate: float) -> None:
        """Show the numbers of each arm's frame, and how many there are in a second."""
        self._head.content = headlines(frames, self._histories)
        self._ellipsoids.content = ellipsoid_table(frames)
        self._methods.content = method_table(frames, self._state, self._method.value, rate)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._shown = round(player.position, 2)
            self._time.value = self._shown

    def _slider(self, gui: Any, name: str, low: float, high: float, step: float, value: float) -> Control:
        return Control(gui.add_slider(name, low, high, step, value), self._access, low=low, high=high)

    def _joint_slider(self, gui: Any, arm: Any, i: int) -> Control:
        """The shoulder and the elbow are bent at first, where the arm is far from singular."""
        bent = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}
        low, high = (round(float(angle), 3) for angle in np.degrees([arm.lower[i], arm.upper[i]]))
        start = float(np.clip(bent.get(arm.joint_names[i], 0.0), low, high))
        return self._slider(gui, arm.joint_names[i], low, high, STEP, start)

    def _add_player(self, gui: Any, duration: float) -> None:
        names, last = (RECORDING, SLIDERS), float(np.ceil(100 * duration) / 100)
        self._source = Control(gui.add_dropdown("Person moved by", names), self._access, names)
        self._player = gui.add_folder("Recording")
        with self._player:
            self._plays = Control(gui.add_checkbox("Play", True), self._access)
            self._time = self._slider(gui, "Time [s]", 0.0, last, 0.01, 0.0)
            self._speed = self._slider(gui, "Speed", 0.1, 2.0, 0.1, 1.0)
        self._shown = 0.0

    def _add_mounting(self, gui: Any, base_rotation: Array) -> None:
        angles, names = _rounded(roll_pitch_yaw(base_rotation)), (*MOUNTINGS, OWN)
        presets = gui.add_dropdown("Robot mounted", names, initial_value=_preset_of(angles))
        self._preset = Control(presets, self._access, names)
        self._chosen = self._preset.value
        with gui.add_folder("Mounting [°]", expand_by_default=False):
            self._angles = [
                self._slider(gui, name, -180.0, 180.0, STEP, angle)
                for name, angle in zip(("roll", "pitch", "yaw"), angles.tolist(), strict=True)
            ]
        self._written = angles

    def _joints(self, seconds: float) -> Array:
        player = self._state.playback
        if player is not None and self._source.value == RECORDING:
            self._show_sliders(False)
            if self._time.value != self._shown:  # someone has moved it
                self._shown = self._time.value
                player.seek(self._shown)
            elif self._plays.value:
                player.advance(self._speed.value * seconds)
            return player.joints()
        if player is not None:
            self._show_sliders(True)
        return np.radians([slider.value for slider in self._sliders])

    def _show_sliders(self, shown: bool) -> None:
        if self._folders[0].visible != shown:
            if shown and self._state.playback is not None:  # go on from where the recording is
                for slider, angle in zip(self._sliders, np.degrees(self._state.playback.joints()), strict=True):
                    slider.value = float(angle)
            self._player.visible = not shown
            for folder in self._folders:
                folder.visible = shown

    def _turned(self) -> Array:
        """The base_rotation of the list, of the sliders or of the rings, whichever was changed."""
        angles, preset = np.array([slider.value for slider in self._angles]), self._preset.value
        if preset != self._chosen:
            self._chosen = preset
            if preset == OWN:
                return self._mounting
            self._take(from_roll_pitch_yaw(np.array(MOUNTINGS[preset])))
        elif not np.array_equal(angles, self._written):
            self._mounting, self._written = from_roll_pitch_yaw(angles), angles
            self._chosen = self._preset.value = _preset_of(angles)
        elif self.gizmo is not None:
            turned = rotation_of(np.asarray(self.gizmo.wxyz)).T
            if np.abs(turned - self._mounting).max() > 1e-6:
                self._take(turned)
            return self._mounting
        if self.gizmo is not None:
            self.gizmo.wxyz = quaternion(self._mounting.T)
        return self._mounting

    def _take(self, base_rotation: Array) -> None:
        """Take a base_rotation, and show it in list and sliders."""
        self._mounting, self._written = base_rotation, _rounded(roll_pitch_yaw(base_rotation))
        for slider, angle in zip(self._angles, self._written.tolist(), strict=True):
            slider.value = angle
        self._chosen = self._preset.value = _preset_of(self._written)


def _preset_of(angles: Array) -> str:
    """Name of a base_rotation in `MOUNTINGS`, or `OWN`."""
    turn = from_roll_pitch_yaw(angles)
    same = (name for name, one in MOUNTINGS.items() if np.allclose(from_roll_pitch_yaw(np.array(one)), turn, atol=1e-6))
    return next(same, OWN)


def _rounded(angles: Array) -> Array:
    return np.round(np.asarray(angles) / STEP) * STEP + 0.0
