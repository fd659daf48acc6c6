"""Base of what a notebook shows as a table of facts; the facts and their look are `maniport.report`'s."""

import importlib
from typing import Any


class ShownInNotebooks:
    """Base of objects that Jupyter shows as a table of facts, once someone asks for it."""

    def _repr_html_(self) -> str:
        # by name: the rooms below telling know nothing of it
        return str(importlib.import_module("maniport.report.renderings").as_html(self))

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, str]:
        # IPython prefers this method; plain text stays what `repr` says
        return {"text/plain": repr(self), "text/html": self._repr_html_()}
