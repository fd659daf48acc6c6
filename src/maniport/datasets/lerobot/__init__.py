"""LeRobot datasets: version 3.0 read and written, version 2.1 read, with pyarrow alone."""

from maniport.datasets.lerobot.layout import STATE, Feature
from maniport.datasets.lerobot.reader import LeRobotDataset
from maniport.datasets.lerobot.writer import Episode, LeRobotWriter, write_lerobot

__all__ = ["STATE", "Episode", "Feature", "LeRobotDataset", "LeRobotWriter", "write_lerobot"]
