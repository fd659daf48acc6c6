"""What the main job returns, its numbers, and the folder it is written to."""

import csv
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from maniport.bodies import Arm, EllipsoidSpec
from maniport.demonstrations import ArmFit, Recording
from maniport.evaluation import Evaluation
from maniport.files import save_ellipsoids
from maniport.folders import folder_written_whole
from maniport.notebook import ShownInNotebooks
from maniport.pipeline.execution import MOTION_FILES, Execution
from maniport.steps import Progress, Step, counted
from maniport.telling.formats import files_of
from maniport.telling.summary import as_markdown, numbers
from maniport.transfer import DomainAdapter
from maniport.validation import Array

FIGURES = ("ellipsoids", "curves", "diffusion_map", "arms")
FILES = (
    "person.csv",
    "demonstrated_profile.npz",
    "target_profile.npz",
    *MOTION_FILES,
    "adapter.npz",
    "summary.md",
    "summary.json",
    "report.html",
    *files_of(*FIGURES),
)
"""The files that `TransferResult.save` writes."""


@dataclass(frozen=True)
class TransferResult(ShownInNotebooks):
    """A person's motion as ellipsoids, and what a robot should make of them.

    Attributes
    ----------
    recording : Recording
    fit : ArmFit
        The person's arm and its joint angles.
    robot : Arm
    method : str
    adapter : DomainAdapter
        Fitted, teacher to student.
    time : ndarray, shape (n,)
        Of the profiles [s].
    demonstrated_profile, target_profile : ndarray, shape (n, d, d)
        The person's ellipsoids in the trunk frame, and the adapted ones in the robot's base frame.
    execution : Execution or None
        The robot's motion: where the hand path lies before it, its joint trajectory, and what that achieves. None
        where the robot cannot be tracked; a warning says why.
    teacher_domain, student_domain : ndarray, shape (N, d, d) and (M, d, d)
    evaluation : Evaluation
        The transfer beside doing less.
    seconds_to_fit : float
    random_state : int
    spec : EllipsoidSpec
        Which ellipsoids were transferred.
    mounting : ndarray, shape (3, 3)
        Rotation from the person's trunk frame to the robot's base frame.
    warnings : tuple of str
        What the steps warned of.
    """

    recording: Recording
    fit: ArmFit
    robot: Arm
    method: str
    adapter: DomainAdapter
    time: Array
    demonstrated_profile: Array
    target_profile: Array
    execution: Execution | None
    teacher_domain: Array
    student_domain: Array
    evaluation: Evaluation
    seconds_to_fit: float
    random_state: int
    spec: EllipsoidSpec
    mounting: Array
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        motion = None if self.execution is None else self.execution.motion
        moved = "not moved" if motion is None else f"moved at d = {np.median(motion.distance):.2f} (median)"
        return (
            f"TransferResult({self.fit.arm.name!r} to {self.robot.name!r} by {self.method}: "
            f"{len(self.time)} ellipsoids, {moved}, {len(self.warnings)} warnings)"
        )

    def _facts(self) -> dict[str, object]:
        return {
            "recording": repr(self.recording),
            "person": repr(self.fit),
            "adapter": repr(self.adapter),
            "execution": "the robot was not moved" if self.execution is None else repr(self.execution),
            "verdict": self.summary()["verdict"],
            "warnings": "\n".join(self.warnings),
        }

    def summary(self) -> dict[str, Any]:
        """All numbers of the run, ready for JSON."""
        return numbers(self)

    def save(self, folder: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write everything to a folder, whole or not at all.

        The folder is made; one that holds nothing but an earlier result is replaced.

        Parameters
        ----------
        folder : str or path-like
        progress : callable, optional
            Called with the name of a step and the fraction done.

        Raises
        ------
        OutputError
            When the folder holds other things, or cannot be written.
        """
        step = Step(progress, "write the results")
        work = [self._write_arrays, self._write_summary, self._write_report, self._draw_ellipsoids, self._draw_domains]
        if self.execution is not None:
            work += [self.execution.write_motion, self._draw_arms]
        with folder_written_whole(folder, FILES) as staging:
            for write in counted(work, len(work), step):
                write(staging)
        step.end(f"in {os.fspath(folder)}/")

    def _write_arrays(self, folder: Path) -> None:
        _write_joint_angles(folder / "person.csv", self.fit)
        save_ellipsoids(folder / "demonstrated_profile.npz", self.demonstrated_profile, self.time)
        save_ellipsoids(folder / "target_profile.npz", self.target_profile, self.time)
        self.adapter.save(folder / "adapter.npz")

    def _write_summary(self, folder: Path) -> None:
        summary = self.summary()
        (folder / "summary.json").write_text(json.dumps(summary, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        (folder / "summary.md").write_text(as_markdown(summary), encoding="utf-8")

    def _write_report(self, folder: Path) -> None:
        from maniport.telling.page import write_report  # matplotlib is slow to load
        from maniport.telling.reports import of_transfer

        write_report(folder / "report.html", of_transfer(self))

    def _draw_ellipsoids(self, folder: Path) -> None:
        from maniport.telling import figures

        if self.spec.part != "full":
            profiles = {"person": self.demonstrated_profile, f"adapted to {self.robot.name}": self.target_profile}
            unit = self.spec.unit
            figures.save(figures.ellipsoids(self.time, profiles, unit=unit), folder / "ellipsoids")
            figures.save(figures.curves(self.time, profiles, unit=unit), folder / "curves")

    def _draw_domains(self, folder: Path) -> None:
        from maniport.telling import figures

        figures.save(figures.diffusion_map(*self._as_fitted(), time=self.time), folder / "diffusion_map")

    def _draw_arms(self, folder: Path) -> None:
        from maniport.telling import figures

        if self.execution is None or self.spec.part == "full":
            return
        robot, motion = self.robot.name, self.execution.motion
        skeletons = {
            "person": self.fit.arm.skeleton(self.fit.joint_angles),
            robot: self.robot.skeleton(motion.joint_positions),
        }
        # the robot follows velocity ellipsoids, whatever kind was transferred: both are drawn in their unit
        force = self.spec.kind == "force"
        person = np.linalg.inv(self.demonstrated_profile) if force else self.demonstrated_profile
        shown, unit = {"person": person, robot: motion.achieved}, self.spec.velocity.unit
        note = "velocity ellipsoids: the inverses of the force ellipsoids" if force else ""
        figures.save(figures.arms(skeletons, shown, unit=unit, note=note), folder / "arms")

    def _as_fitted(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Domains and profiles as the fit saw them: regularised, since singular ones are infinitely far away."""
        teacher, student = self.adapter.teacher_side, self.adapter.student_side
        robot, adapted = self.robot.name, f"adapted to {self.robot.name}"
        domains = {
            "person": teacher(self.teacher_domain),
            robot: student(self.student_domain),
        }
        profiles = {
            "person": teacher(self.demonstrated_profile),
            adapted: student(self.target_profile),
        }
        return domains, profiles


def _write_joint_angles(path: Path, fit: ArmFit) -> None:
    with open(path, "w", newline="", encoding="utf-8") as stream:
        rows = csv.writer(stream)
        rows.writerow(["time_s", *(f"{name}_deg" for name in fit.arm.joint_names)])
        for t, angles in zip(fit.time, np.degrees(fit.joint_angles), strict=True):
            rows.writerow([f"{t:.6f}", *(f"{angle:.4f}" for angle in angles)])
