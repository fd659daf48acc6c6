"""HTML display in notebooks, rendered by `maniport.report`."""

import importlib
from typing import Any


class NotebookDisplay:
    """Base of objects that Jupyter displays as a table of metrics."""

    def _repr_html_(self) -> str:
        # imported by name, since packages below must not import the report
        return str(importlib.import_module("maniport.report.renderings").as_html(self))

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, str]:
        # IPython prefers this method; plain text stays that of `repr`
        return {"text/plain": repr(self), "text/html": self._repr_html_()}
