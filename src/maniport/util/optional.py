"""Packages that only some of the work needs, imported when it is done."""

import importlib
from functools import partial
from types import ModuleType

from maniport.errors import MissingPackageError


def how_to_install(extra: str) -> str:
    """Return the command that installs an extra; in quotes, since some shells take brackets for a pattern."""
    return f'in the clone: pip install ".[{extra}]"'


def optional_package(name: str, extra: str, what: str) -> ModuleType:
    """Import a package that may not be installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingPackageError(
            f"{what} needs {name}, which cannot be imported ({error}); {how_to_install(extra)}"
        ) from None


matplotlib = partial(optional_package, "matplotlib", "figures", "drawing figures")
viser = partial(optional_package, "viser", "view", "the live view")
xacrodoc = partial(optional_package, "xacrodoc.xacrodoc", "xacro", "a .xacro file")
mcap_writer = partial(optional_package, "mcap.writer", "mcap", "the format 'mcap'")
mcap_reader = partial(optional_package, "mcap.reader", "mcap", "a ROS bag")
pyarrow = partial(optional_package, "pyarrow", "parquet", "the format 'parquet'")
parquet_writer = partial(optional_package, "pyarrow.parquet", "parquet", "the format 'parquet'")
arrow_of_datasets = partial(optional_package, "pyarrow", "datasets", "a LeRobot dataset")
parquet_of_datasets = partial(optional_package, "pyarrow.parquet", "datasets", "a LeRobot dataset")
arrow_of_batches = partial(optional_package, "pyarrow", "datasets", "a packed batch")
parquet_of_batches = partial(optional_package, "pyarrow.parquet", "datasets", "a packed batch")
rerun = partial(optional_package, "rerun", "rerun", "the format 'rerun'")
distributed = partial(optional_package, "distributed", "dask", "work on a Dask cluster")
mujoco = partial(optional_package, "mujoco", "simulate", "the simulation of a robot")
ray = partial(optional_package, "ray", "ray", "work on Ray")
