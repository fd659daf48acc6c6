"""viser, which is optional and imported when it is first needed."""

import importlib
from typing import Any

from maniport.errors import MissingPackageError


def viser() -> Any:
    """Import viser.

    Raises
    ------
    MissingPackageError
        When it cannot be imported; the message says how to install it.
    """
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise MissingPackageError(
            f"the live view needs viser, which cannot be imported ({error}): pip install maniport[view]"
        ) from None
