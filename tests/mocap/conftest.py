"""Synthetic recordings made from an arm's own forward kinematics, and small files in both formats."""

import ezc3d
import numpy as np
import pytest

from maniport import arms
from maniport.mocap import performed

SIDES = ("elbow_medial", "elbow_lateral", "wrist_ulnar", "wrist_radial")


@pytest.fixture
def slow_motion():
    """Return a maker of slow joint paths well inside an arm's limits, shape (n, dof).

    Every joint moves at its own constant speed, or with ``curved`` swings at 0.2 Hz.
    """

    def make(arm, n=60, seconds=2.0, curved=False):
        time = np.linspace(0.0, seconds, n)
        middle, half = (arm.upper + arm.lower) / 2, (arm.upper - arm.lower) / 2
        phase = np.arange(arm.dof)
        swing = (
            np.sin(2 * np.pi * 0.2 * time[:, None] + phase)
            if curved
            else np.sin(phase) * (2 * time[:, None] / seconds - 1)
        )
        return time, middle + 0.6 * half * swing

    return make


@pytest.fixture
def record():
    """Return a maker of recordings in which an arm moves on a trunk that stands still."""

    def make(arm, time, q, axes=True, hand=True):
        whole = performed(arm, q, time, "synthetic")
        left_out = (() if axes else SIDES) + (() if hand else ("hand",))
        return whole.select([name for name in whole.names if name not in left_out])

    return make


@pytest.fixture(params=["myoarm", "rhuman"])
def arm(request):
    """Both human arms, with a person's lengths."""
    return getattr(arms, request.param)(upper_arm=0.31, forearm=0.26, hand=0.06)


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Spine
  {
    OFFSET 0 20 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    JOINT Neck
    {
      OFFSET 0 30 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      End Site
      {
        OFFSET 0 10 0
      }
    }
    JOINT RightArm
    {
      OFFSET -18 28 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      JOINT RightForeArm
      {
        OFFSET -30 0 0
        CHANNELS 3 Zrotation Yrotation Xrotation
        JOINT RightHand
        {
          OFFSET -26 0 0
          CHANNELS 3 Zrotation Yrotation Xrotation
          End Site
          {
            OFFSET -8 0 0
          }
        }
      }
    }
    JOINT LeftArm
    {
      OFFSET 18 28 0
      CHANNELS 3 Zrotation Yrotation Xrotation
      End Site
      {
        OFFSET 30 0 0
      }
    }
  }
}
MOTION
"""


@pytest.fixture
def bvh_file(tmp_path):
    """Return a writer of small BVH files in centimetres: a T-pose whose right forearm bends, 50 frames a second."""

    def write(frames=6, declared=None, text=BVH, scale=1.0, name="small.bvh"):
        rows = []
        for t in range(frames):
            values = np.zeros(24)
            values[1] = 100 * scale
            values[15] = 0.5 * t
            values[13] = 10 + 2 * t
            rows.append(" ".join(f"{v:g}" for v in values))
        lines = []
        for line in text.splitlines():
            words = line.split()
            if words[:1] == ["OFFSET"]:
                line = "OFFSET " + " ".join(f"{float(w) * scale:.6f}" for w in words[1:])
            lines.append(line)
        head = [f"Frames: {frames if declared is None else declared}", "Frame Time: 0.02"]
        file = tmp_path / name
        file.write_text("\n".join([*lines, *head, *rows]) + "\n")
        return file

    return write


@pytest.fixture
def c3d_file(tmp_path):
    """Return a writer of C3D files from points (n_frames, n_points, 3)."""

    def write(points, labels, unit="mm", rate=100.0, residuals=None, name="small.c3d"):
        content = ezc3d.c3d()
        content["parameters"]["POINT"]["RATE"]["value"] = [rate]
        content["parameters"]["POINT"]["LABELS"]["value"] = list(labels)
        content["parameters"]["POINT"]["UNITS"]["value"] = [unit]
        data = np.ones((4, points.shape[1], points.shape[0]))
        data[:3] = np.moveaxis(points, 2, 0).swapaxes(1, 2)
        content["data"]["points"] = data
        if residuals is not None:
            content["data"]["meta_points"]["residuals"] = np.asarray(residuals, dtype=float).T[None]
        file = tmp_path / name
        content.write(str(file))
        return file

    return write
