"""Base of results that are saved as a folder of data files."""

import os
from pathlib import Path

from maniport.util.atomic_io import folder_written_whole
from maniport.util.notebook import NotebookDisplay


class SavedResult(NotebookDisplay):
    """Base of results that are saved as a folder of data files."""

    @property
    def data_files(self) -> tuple[str, ...]:
        """Names of the files and folders that `save` may write."""
        raise NotImplementedError

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the data to a folder, whole or not at all; `maniport.write_results` adds a report.

        Raises
        ------
        OutputError
            When the folder holds earlier data and `overwrite` is false, or other files, or cannot be written.
        """
        with folder_written_whole(folder, self.data_files, overwrite) as staging:
            self.write_data(staging)

    def write_data(self, folder: Path) -> None:
        """Write the data files into an existing folder."""
        raise NotImplementedError
