"""Display in notebooks."""

from collections.abc import Callable

_renderers: list[Callable[[object], str]] = []


def render_with(renderer: Callable[[object], str]) -> None:
    """Set the function that returns the Markdown of an object; the package sets it when it is imported."""
    _renderers[:] = [renderer]


class NotebookDisplay:
    """Base of objects that Jupyter displays with their metrics."""

    def _repr_mimebundle_(self, **kwargs: object) -> dict[str, str]:
        displays = {"text/plain": repr(self)}
        for renderer in _renderers:
            displays["text/markdown"] = renderer(self)
        return displays
