"""The controls beside the space: what is wished, and the numbers."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from maniport.validation import Array
from maniport.view.bodies import from_roll_pitch_yaw, quaternion, roll_pitch_yaw, rotation_of
from maniport.view.controls import Control, choice, slider, switch
from maniport.view.door import Door
from maniport.view.numbers import Course, headlines, of_ellipsoids, of_methods
from maniport.view.pair import LivePair
from maniport.view.picture import Picture, Wish
from maniport.view.state import LiveState

STEP = 0.5
"""Of the sliders of angles [degrees]."""
RECORDING, SLIDERS = "recording", "sliders"
MOUNTINGS = {
    "as the person": (0.0, 0.0, 0.0),
    "facing the person": (0.0, 0.0, 180.0),
    "on a wall": (0.0, -90.0, 0.0),
    "from the ceiling": (180.0, 0.0, 0.0),
    "at the person's right side": (-90.0, 0.0, 0.0),
}
"""Usual mountings by name: roll, pitch and yaw from the person's trunk frame to the robot's base frame [degrees]."""
OWN = "own"
POSTURE = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}
"""Where the sliders of a person's arm start [degrees]; the others at zero."""


class Panel:
    """The controls; they are asked for their values, in the loop, and call nothing.

    Parameters
    ----------
    gui : viser.GuiApi
    state : LiveState or LivePair
    method : str
        Shown first.
    mounting : ndarray, shape (3, 3)
        The first one.
    door : Door
        Logs values that a control cannot have.
    bare : str
        Why there is no surface of the robot to show; empty where there is one.
    """

    def __init__(self, gui: Any, state: LiveState | LivePair, method: str, mounting: Array, door: Door, bare: str = ""):
        self._state, self._mounting, self._door = state, mounting, door
        self._leap, self._courses = threading.Event(), [Course() for _ in state.each]
        self.gizmo: Any = None
        self._head = gui.add_html("")
        methods = gui.add_dropdown("Method", state.methods, initial_value=method, hint="How ellipsoids are mapped")
        self._method = choice(methods, state.methods, door)
        follows = gui.add_checkbox(
            "Tip follows too", state.playback is not None,
            hint="The robot's tip goes where the person's hand goes; it then cannot make all of the ellipsoid",
        )  # fmt: skip
        self._follows = switch(follows, door)
        leap = gui.add_button("Find a better posture", hint="Lets the robot jump to the best posture that is found")
        leap.on_click(lambda _: self._leap.set())
        if state.playback is not None:
            self._add_player(gui, state.playback.duration)
        self._folders, self._sliders = [], list[Control]()
        for one in state.each:
            whose = f"{one.teacher.side} " if len(state.each) > 1 else ""
            self._folders.append(gui.add_folder(f"Person's {whose}joints [°]", visible=state.playback is None))
            with self._folders[-1]:
                self._sliders += [_joint_slider(gui, one.teacher, i, door) for i in range(one.teacher.dof)]
        self._add_mounting(gui, mounting)
        alone = len(state.each) == 1
        hint = (
            "Off again, it is written where maniport was started"
            if alone
            else "Of one arm at a time: --arm left or right"
        )
        self._record = switch(gui.add_checkbox("Record what I play", False, disabled=not alone, hint=hint), door)
        self._written_to = gui.add_markdown("", visible=False)
        with gui.add_folder("Compare the methods", expand_by_default=False):
            self._methods = gui.add_markdown("")
        with gui.add_folder("Numbers and looks", expand_by_default=False):
            self._ellipsoids = gui.add_markdown("")
            surface = gui.add_checkbox(
                "Robot's surface", not bare, disabled=bool(bare), hint=bare or "Or its skeleton, to look inside"
            )
            self._surface = switch(surface, door)

    @property
    def covered(self) -> bool:
        """Whether the robot is wished with its surface."""
        return bool(self._surface.value)

    @property
    def records(self) -> bool:
        """Whether what is played shall be recorded."""
        return len(self._state.each) == 1 and bool(self._record.value)

    def read(self, seconds: float) -> Wish:
        """What is wished now, `seconds` after the last time."""
        if self._leap.is_set():
            self._leap.clear()
            self._state.leap()
        return Wish(self._joints(seconds), self._method.value, self._turned(), self._follows.value)

    def note(self, pictures: Sequence[Picture], seconds: float) -> None:
        """Remember the distances of pictures, some time after the last ones [s]."""
        for course, picture in zip(self._courses, pictures, strict=True):
            course.add(seconds, picture.distance)

    def tell(self, words: str) -> None:
        """Say what became of a recording."""
        self._written_to.content, self._written_to.visible = words, True

    def write(self, pictures: Sequence[Picture], rate: float) -> None:
        """Show the numbers of each arm's picture, and how many there are in a second."""
        self._head.content = headlines(pictures, self._courses)
        self._ellipsoids.content = of_ellipsoids(pictures)
        self._methods.content = of_methods(pictures, self._state, self._method.value, rate)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._shown = round(player.position, 2)
            self._time.value = self._shown

    def _add_player(self, gui: Any, duration: float) -> None:
        names, last = (RECORDING, SLIDERS), float(np.ceil(100 * duration) / 100)
        self._source = choice(gui.add_dropdown("Person moved by", names), names, self._door)
        self._player = gui.add_folder("Recording")
        with self._player:
            self._plays = switch(gui.add_checkbox("Play", True), self._door)
            self._time = slider(gui.add_slider("Time [s]", 0.0, last, 0.01, 0.0), 0.0, last, self._door)
            self._speed = slider(gui.add_slider("Speed", 0.1, 2.0, 0.1, 1.0), 0.1, 2.0, self._door)
        self._shown = 0.0

    def _add_mounting(self, gui: Any, mounting: Array) -> None:
        angles, names = _rounded(roll_pitch_yaw(mounting)), (*MOUNTINGS, OWN)
        self._preset = choice(
            gui.add_dropdown("Robot mounted", names, initial_value=_preset_of(angles)), names, self._door
        )
        self._chosen = self._preset.value
        with gui.add_folder("Mounting [°]", expand_by_default=False):
            self._angles = [
                slider(gui.add_slider(name, -180.0, 180.0, STEP, angle), -180.0, 180.0, self._door)
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
        return np.radians([one.value for one in self._sliders])

    def _show_sliders(self, shown: bool) -> None:
        if self._folders[0].visible != shown:
            if shown and self._state.playback is not None:  # go on from where the recording is
                for one, angle in zip(self._sliders, np.degrees(self._state.playback.joints()), strict=True):
                    one.value = float(angle)
            self._player.visible = not shown
            for folder in self._folders:
                folder.visible = shown

    def _turned(self) -> Array:
        """The mounting: that of the list, of the sliders or of the rings in space, whichever was changed."""
        angles, preset = np.array([one.value for one in self._angles]), self._preset.value
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

    def _take(self, mounting: Array) -> None:
        """Take a mounting, and let list and sliders show it."""
        self._mounting, self._written = mounting, _rounded(roll_pitch_yaw(mounting))
        for one, angle in zip(self._angles, self._written.tolist(), strict=True):
            one.value = angle
        self._chosen = self._preset.value = _preset_of(self._written)


def _preset_of(angles: Array) -> str:
    """Name of a mounting in `MOUNTINGS`, or `OWN`."""
    turn = from_roll_pitch_yaw(angles)
    same = (name for name, one in MOUNTINGS.items() if np.allclose(from_roll_pitch_yaw(np.array(one)), turn, atol=1e-6))
    return next(same, OWN)


def _joint_slider(gui: Any, arm: Any, i: int, door: Door) -> Control:
    low, high = (round(float(angle), 3) for angle in np.degrees([arm.lower[i], arm.upper[i]]))
    start = float(np.clip(POSTURE.get(arm.joint_names[i], 0.0), low, high))
    return slider(gui.add_slider(arm.joint_names[i], low, high, STEP, start), low, high, door)


def _rounded(angles: Array) -> Array:
    return np.round(np.asarray(angles) / STEP) * STEP + 0.0
