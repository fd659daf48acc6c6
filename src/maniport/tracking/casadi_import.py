"""CasADi, which is optional and imported when it is first needed."""

import importlib
from typing import Any

from maniport.errors import MissingPackageError


def casadi() -> Any:
    """Import CasADi.

    Raises
    ------
    MissingPackageError
        When it cannot be imported; the message says how to install it.
    """
    try:
        return importlib.import_module("casadi")
    except ImportError as error:
        raise MissingPackageError(
            f"this needs CasADi, which cannot be imported ({error}): pip install maniport[offline]"
        ) from None
