"""The panel of the page: controls, the distance of each arm, and a table of the methods."""

import threading
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from maniport.evaluation.summary import LOOKUP
from maniport.report.metrics import in_axes
from maniport.report.page.content import ACHIEVED, PERSON, TARGET
from maniport.util.validation import Array
from maniport.viewer.access_control import AccessControl, Control
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

LEGEND = "".join(
    f'<span style="color: rgb{role.rgb}; margin-right: 0.9em; font-weight: bold">● {role.name}</span>'
    for role in (PERSON, TARGET, ACHIEVED)
)
"""Colors of the ellipsoids."""


class Panel:
    """Controls and numbers; the loop reads the controls, which call nothing."""

    def __init__(self, gui: Any, state: ViewState, method: str, base_rotation: Array, access: AccessControl):
        self._gui, self._state, self._base_rotation, self._access = gui, state, base_rotation, access
        self._jump, player = threading.Event(), state.playback
        several = len(state.sides) > 1
        self._names = [f"{side.teacher.side}: " if several else "" for side in state.sides]
        moved = "The recording moves" if player is not None else "Move the sliders of"
        gui.add_markdown(f"{moved} the person's arm; the robot follows. Drag to rotate the view.")
        self._head = gui.add_html("")
        self._method = self._list("Method", state.methods, method)
        self._follows = self._switch("End effector follows", player is not None)
        jump = gui.add_button("Find a better configuration", hint="The robot jumps to the best configuration found")
        jump.on_click(lambda _: self._jump.set())
        if player is not None:
            self._source = self._list("Person moved by", (RECORDING, SLIDERS), RECORDING)
            self._player, self._written_time = gui.add_folder("Recording"), 0.0
            with self._player:
                self._plays = self._switch("Play", True)
                self._time = self._slider("Time [s]", 0.0, float(np.ceil(100 * player.duration) / 100), 0.01, 0.0)
                self._speed = self._slider("Speed", 0.1, 2.0, 0.1, 1.0)
        self._folders, self._sliders = [], list[Control]()
        bent = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}  # at first, far from singular
        for side in state.sides:
            arm, name = side.teacher, f"{side.teacher.side} " if several else ""
            self._folders.append(gui.add_folder(f"Person's {name}joints [°]", visible=player is None))
            with self._folders[-1]:
                for joint, *limits in zip(arm.joint_names, np.degrees(arm.lower), np.degrees(arm.upper), strict=True):
                    low, high = (round(float(angle), 3) for angle in limits)
                    start = float(np.clip(bent.get(joint, 0.0), low, high))
                    self._sliders.append(self._slider(readable(joint), low, high, STEP, start))
        self._written = np.round(roll_pitch_yaw(base_rotation) / STEP) * STEP + 0.0
        self._preset = self._list("Base orientation", (*BASE_ORIENTATIONS, OWN), _preset_of(self._written))
        self._chosen = self._preset.value
        with gui.add_folder("Base orientation [°]", expand_by_default=False):
            angles = zip(("roll", "pitch", "yaw"), self._written.tolist(), strict=True)
            self._angles = [self._slider(name, -180.0, 180.0, STEP, angle) for name, angle in angles]
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
        self._head.content = _headlines(frames, self._names)
        self._methods.content = _method_table(frames, self._state, self._method.value, self._names)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._written_time = round(player.position, 2)
            self._time.value = self._written_time

    def _slider(self, name: str, low: float, high: float, step: float, value: float) -> Control:
        slider = self._gui.add_slider(name, low, high, step, value)
        return Control(slider, self._access, lambda value: isinstance(value, (int, float)) and low <= value <= high)

    def _list(self, name: str, options: Sequence[str], value: str) -> Control:
        dropdown = self._gui.add_dropdown(name, options, initial_value=value)
        return Control(dropdown, self._access, lambda value: value in options)

    def _switch(self, name: str, value: bool) -> Control:
        return Control(self._gui.add_checkbox(name, value), self._access, lambda value: isinstance(value, bool))

    def _joints(self, seconds: float) -> Array:
        """Return the joints of the person, from the recording or the sliders [rad]."""
        player = self._state.playback
        if player is not None:
            recorded = self._source.value == RECORDING
            if self._player.visible and not recorded:  # the sliders continue from the recording
                for slider, angle in zip(self._sliders, np.degrees(player.joints()), strict=True):
                    slider.value = float(angle)
            if self._player.visible != recorded:
                self._player.visible = recorded
                for folder in self._folders:
                    folder.visible = not recorded
            if recorded:
                if self._time.value != self._written_time:  # the slider was moved
                    self._written_time = self._time.value
                    player.seek(self._written_time)
                elif self._plays.value:
                    player.advance(self._speed.value * seconds)
                return player.joints()
        return np.radians([slider.value for slider in self._sliders])

    def _base(self) -> Array:
        """Return the base orientation of the list or of the sliders, whichever was changed."""
        angles, preset = np.array([slider.value for slider in self._angles]), self._preset.value
        if preset != self._chosen:
            self._chosen = preset
            if preset == OWN:
                return self._base_rotation
            angles = np.array(BASE_ORIENTATIONS[preset])
            for slider, angle in zip(self._angles, angles.tolist(), strict=True):
                slider.value = angle
        elif np.array_equal(angles, self._written):
            return self._base_rotation
        else:
            self._chosen = self._preset.value = _preset_of(angles)
        self._base_rotation, self._written = from_roll_pitch_yaw(angles), angles
        return self._base_rotation


def _preset_of(angles: Array) -> str:
    """Return the name of a base orientation in `BASE_ORIENTATIONS`, or `OWN`."""
    rotation = from_roll_pitch_yaw(angles)
    named = ((name, from_roll_pitch_yaw(np.array(item))) for name, item in BASE_ORIENTATIONS.items())
    return next((name for name, item in named if np.allclose(item, rotation, atol=1e-6)), OWN)


def roll_pitch_yaw(rotation: Array) -> Array:
    """Return roll, pitch and yaw of a rotation about fixed axes, as in URDF, shape (3,) [degrees]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a pitch of ±90° one of the other two is arbitrary
        return np.asarray(Rotation.from_matrix(rotation).as_euler("xyz", degrees=True))


def from_roll_pitch_yaw(degrees: Array) -> Array:
    """Return the rotation matrix of roll, pitch and yaw about fixed axes [degrees]."""
    return np.asarray(Rotation.from_euler("xyz", degrees, degrees=True).as_matrix())


def readable(name: str) -> str:
    """Write the name of a joint or a method in words."""
    words = {"elv": "elevation", "rot": "rotation", "pro": "pronation", "sup": "supination"}
    return " ".join(words.get(word, word) for word in name.replace("_", " ").replace("-", " ").split())


def _headlines(frames: Sequence[Frame], names: Sequence[str]) -> str:
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


def _method_table(frames: Sequence[Frame], state: ViewState, method: str, names: Sequence[str]) -> str:
    """Write the feasibility gap of each method's target for each arm, and notes about fits and targets."""
    maps = [side.maps.fitted for side in state.sides]
    gaps = [side.gaps(frame.target.demonstrated) for side, frame in zip(state.sides, frames, strict=True)]
    head = " | ".join(f"{name}feasibility gap" for name in names)
    rows = [f"| method | {head} |", "|---" * (len(maps) + 1) + "|"]
    for item in state.methods:
        label = f"**{readable(item)}**" if item == method else readable(item)
        cells = []
        for own, values in zip(maps, gaps, strict=True):
            gap = None if item == LOOKUP else values.get(item)  # samples of the robot have no gap by construction
            cells.append("fitting …" if item not in own else "—" if gap is None else f"{gap:.2f}")
        rows.append(f"| {label} | {' | '.join(cells)} |")
    notes = []
    for name, own, frame in zip(names, maps, frames, strict=True):
        texts = own[method].notes if method in own else ()
        notes += [f"*{name}{note}*\n" for note in (*texts, frame.target.note) if note]
    meaning = "Feasibility gap: distance from the target to the nearest feasible ellipsoid found."
    return "\n".join([*rows, "", meaning, "", *notes])
