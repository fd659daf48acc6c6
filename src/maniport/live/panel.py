"""The controls beside the space: what is wished, and the numbers."""

import threading
from typing import Any

import numpy as np

from maniport.live.bodies import from_roll_pitch_yaw, quaternion, roll_pitch_yaw, rotation_of
from maniport.live.state import LiveState, Picture, Wish
from maniport.spd.ellipsoid import lengths, volume
from maniport.telling.roles import ACHIEVED, PERSON, TARGET
from maniport.validation import Array

STEP = 0.5
"""Of the sliders of angles [degrees]."""
RECORDING, SLIDERS = "recording", "sliders"
WIDTH = 350
"""Of the numbers [pixels]."""
LEGEND = "".join(
    f'<span style="color: rgb{color}; margin-left: 1em; font-weight: bold">● {name}</span>'
    for name, color in ((role.name, role.rgb) for role in (PERSON, TARGET, ACHIEVED))
)
"""Which colour is whose ellipsoid."""
POSTURE = {"elv_angle": 60.0, "shoulder_elv": 50.0, "elbow_flexion": 80.0}
"""Where the sliders of a person's arm start [degrees]; the others at zero."""


class Panel:
    """The controls; they are asked for their values, in the loop, and call nothing.

    Parameters
    ----------
    gui : viser.GuiApi
    state : LiveState
    method : str
        Shown first.
    mounting : ndarray, shape (3, 3)
        The first one.
    bare : str
        Why there is no surface of the robot to show; empty where there is one.
    """

    def __init__(self, gui: Any, state: LiveState, method: str, mounting: Array, bare: str = ""):
        self._state, self._mounting = state, mounting
        self._leap, self._straight = threading.Event(), threading.Event()
        self.gizmo: Any = None
        self._method = gui.add_dropdown("Method", state.methods, initial_value=method, hint="How ellipsoids are mapped")
        self._follows = gui.add_checkbox(
            "Tip follows too", state.playback is not None,
            hint="The robot's tip goes where the person's hand goes; it then cannot make all of the ellipsoid",
        )  # fmt: skip
        leap = gui.add_button("Find a better posture", hint="Lets the robot jump to the best posture that is found")
        leap.on_click(lambda _: self._leap.set())
        self._surface = gui.add_checkbox(
            "Robot's surface", not bare, disabled=bool(bare), hint=bare or "Or its skeleton, to look inside"
        )
        if state.playback is not None:
            self._add_player(gui, state.playback.duration)
        self._joints_folder = gui.add_folder("Person's joints [°]", visible=state.playback is None)
        with self._joints_folder:
            self._sliders = [_joint_slider(gui, state.teacher, i) for i in range(state.teacher.dof)]
        with gui.add_folder("Robot's mounting [°]"):
            angles = _rounded(roll_pitch_yaw(mounting))
            names = ("roll", "pitch", "yaw")
            self._angles = [
                gui.add_slider(n, -180.0, 180.0, STEP, a) for n, a in zip(names, angles.tolist(), strict=True)
            ]
            gui.add_button("As the person").on_click(lambda _: self._straight.set())
        self._written = angles
        beside = gui.add_panel()
        with beside.add_tab("Numbers"):
            gui.add_html(LEGEND)
            self._numbers = gui.add_markdown("")
        beside.float(x=15, y=-15, width=WIDTH)

    @property
    def covered(self) -> bool:
        """Whether the robot is wished with its surface."""
        return bool(self._surface.value)

    def read(self, seconds: float) -> Wish:
        """What is wished now, `seconds` after the last time."""
        if self._leap.is_set():
            self._leap.clear()
            self._state.leap()
        return Wish(self._joints(seconds), self._method.value, self._turned(), self._follows.value)

    def write(self, picture: Picture, rate: float) -> None:
        """Show the numbers of a picture, and how many pictures there are in a second."""
        self._numbers.content = as_markdown(picture, self._state, self._method.value, rate)
        player = self._state.playback
        if player is not None and self._plays.value:
            self._shown = round(player.position, 2)
            self._time.value = self._shown

    def _add_player(self, gui: Any, duration: float) -> None:
        self._source = gui.add_dropdown("Person moved by", (RECORDING, SLIDERS))
        self._player = gui.add_folder("Recording")
        with self._player:
            self._plays = gui.add_checkbox("Play", True)
            self._time = gui.add_slider("Time [s]", 0.0, float(np.ceil(100 * duration) / 100), 0.01, 0.0)
            self._speed = gui.add_slider("Speed", 0.1, 2.0, 0.1, 1.0)
        self._shown = 0.0

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
        if self._joints_folder.visible != shown:
            if shown and self._state.playback is not None:  # go on from where the recording is
                for slider, angle in zip(self._sliders, np.degrees(self._state.playback.joints()), strict=True):
                    slider.value = float(angle)
            self._joints_folder.visible, self._player.visible = shown, not shown

    def _turned(self) -> Array:
        """The mounting: that of the sliders or of the rings in space, whichever was moved."""
        angles = np.array([slider.value for slider in self._angles])
        if self._straight.is_set():
            self._straight.clear()
            self._mounting = np.eye(3)
            self._write_angles()
        elif not np.array_equal(angles, self._written):
            self._mounting, self._written = from_roll_pitch_yaw(angles), angles
        elif self.gizmo is None:
            return self._mounting
        else:
            turned = rotation_of(np.asarray(self.gizmo.wxyz)).T
            if np.abs(turned - self._mounting).max() > 1e-6:
                self._mounting = turned
                self._write_angles()
            return self._mounting
        if self.gizmo is not None:
            self.gizmo.wxyz = quaternion(self._mounting.T)
        return self._mounting

    def _write_angles(self) -> None:
        self._written = _rounded(roll_pitch_yaw(self._mounting))
        for slider, angle in zip(self._angles, self._written.tolist(), strict=True):
            slider.value = angle


def _joint_slider(gui: Any, arm: Any, i: int) -> Any:
    low, high = np.degrees([arm.lower[i], arm.upper[i]])
    start = float(np.clip(POSTURE.get(arm.joint_names[i], 0.0), low, high))
    return gui.add_slider(arm.joint_names[i], round(float(low), 3), round(float(high), 3), STEP, start)


def _rounded(angles: Array) -> Array:
    return np.round(np.asarray(angles) / STEP) * STEP + 0.0


def as_markdown(picture: Picture, state: LiveState, method: str, rate: float) -> str:
    """Write what a picture shows as numbers: three ellipsoids, how near they are, and the other methods."""
    three = {
        PERSON.name: picture.demonstrated_ellipsoid,
        TARGET.name: picture.target_ellipsoid,
        ACHIEVED.name: picture.achieved_ellipsoid,
    }
    lines = [
        f"**Robot to target: distance {picture.distance:.2f}**"
        + ("" if picture.position_error is None else f", tip {1e3 * picture.position_error:.1f} mm off"),
        "",
        "| | longest | shortest | volume | condition |",
        "|---|---|---|---|---|",
        *(f"| {name} | {_row(ellipsoid)} |" for name, ellipsoid in three.items()),
        "",
        "Semi-axes in m/s per rad/s.",
        "",
        "| method | feasibility gap | fit |",
        "|---|---|---|",
    ]
    maps, gaps = state.refitting.maps, state.gaps(picture.demonstrated_ellipsoid)
    for name, one in maps.items():
        here = "none" if gaps[name] is None else f"{gaps[name]:.2f}"
        spent = f"{1e3 * one.seconds:.0f} ms" if one.seconds else "none"
        label = f"**{name}**" if name == method else name
        lines.append(f"| {label} | {here} | {spent} |")
    lines += ["", "Feasibility gap: distance from the target to the nearest ellipsoid that was found for the robot."]
    chosen = maps[method]
    lines += ["", *(f"*{text}*\n" for text in (chosen.ending, *chosen.notes, picture.note) if text)]
    lines += [f"{rate:.0f} pictures a second" + ("; fitting …" if state.refitting.busy else "")]
    return "\n".join(lines)


def _row(ellipsoid: Array) -> str:
    semi_axes = lengths(ellipsoid)
    with np.errstate(divide="ignore"):
        condition = float((semi_axes[-1] / semi_axes[0]) ** 2)
    told = f"{condition:.3g}" if condition < 1e6 else "flat"
    return f"{semi_axes[-1]:.2f} | {semi_axes[0]:.2f} | {float(volume(ellipsoid)):.2f} | {told}"
