"""NPY, one NumPy array: positions of joints without a word."""

from pathlib import Path

from maniport.demonstrations.given import Given
from maniport.demonstrations.readers.named import named_positions
from maniport.demonstrations.recording import Recording
from maniport.errors import FileFormatError
from maniport.files import read_npy
from maniport.input_limits import RECORDING_BYTES, existing_file


def read(file: Path, given: Given) -> Recording:
    """Read an ``.npy`` file of positions (n, k, 3); see `maniport.demonstrations.readers.read_recording`."""
    size = existing_file(file, (), RECORDING_BYTES).stat().st_size
    try:
        with open(file, "rb") as stream:
            positions = read_npy(stream, size)
    except Exception as error:  # noqa: BLE001 - NumPy raises errors of many types on damaged files
        raise FileFormatError(f"{file}: not a readable .npy file: {error}") from None
    return named_positions(file, given, None, positions, None)
