"""Files of robot-learning datasets: motions of joints, read and written in one module a format."""

from maniport.datasets.gmr_pickle import read_gmr_pickle, write_gmr_pickle
from maniport.datasets.joint_motion import JointMotion
from maniport.datasets.mjlab_npz import read_mjlab_npz, write_mjlab_npz
from maniport.datasets.unitree_csv import G1_JOINTS, read_unitree_csv, write_unitree_csv

__all__ = [
    "G1_JOINTS",
    "JointMotion",
    "read_gmr_pickle",
    "read_mjlab_npz",
    "read_unitree_csv",
    "write_gmr_pickle",
    "write_mjlab_npz",
    "write_unitree_csv",
]
