"""Display in notebooks, rendered by `maniport.report`."""

import importlib
from typing import Any


class NotebookDisplay:
    """Base of objects that Jupyter displays with their metrics."""

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, str]:
        # imported by name, since packages below must not import the report
        report = importlib.import_module("maniport.report")
        return {
            "text/plain": repr(self),
            "text/markdown": report.as_markdown(report.report_of(self), details=True),
        }
