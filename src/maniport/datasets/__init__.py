"""Files of robot-learning datasets: motions of joints, read and written in one module a format."""

from maniport.datasets.gmr_pickle import read_gmr_pickle, write_gmr_pickle
from maniport.datasets.joint_files import read_joints_csv, read_joints_npz
from maniport.datasets.joint_motion import JointMotion
from maniport.datasets.mjlab_npz import read_mjlab_npz, write_mjlab_npz
from maniport.datasets.ros_bag import read_ros_bag
from maniport.datasets.source import ReadOptions, Source, open_dataset
from maniport.datasets.unitree_csv import G1_JOINTS, read_unitree_csv, write_unitree_csv

__all__ = [
    "G1_JOINTS",
    "JointMotion",
    "ReadOptions",
    "Source",
    "open_dataset",
    "read_gmr_pickle",
    "read_joints_csv",
    "read_joints_npz",
    "read_mjlab_npz",
    "read_ros_bag",
    "read_unitree_csv",
    "write_gmr_pickle",
    "write_mjlab_npz",
    "write_unitree_csv",
]
