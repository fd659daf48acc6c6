"""Work that another process may do meanwhile, where there is one; else it is done when somebody asks for the result."""

from collections.abc import Callable
from typing import Protocol, TypeVar

T = TypeVar("T")


class Helper(Protocol):
    """Another process that takes on work."""

    def take(self, work: Callable[[], T], here: Callable[[], T]) -> Callable[[], T]:
        """Take on work; return what gives its result once."""

    def bridge(self, work: Callable[[], object]) -> None:
        """Do some work here while a result is waited for, if one is."""


helper: Helper | None = None
"""Who takes on work now."""


def aside(work: Callable[[], T], here: Callable[[], T] | None = None) -> Callable[[], T]:
    """Let work be done meanwhile where somebody takes it; return what gives its result, and is called at most once.

    Parameters
    ----------
    work : callable
        It depends on nothing that changes later, has the same result wherever it is done, and can be pickled (a
        `functools.partial` of a function of a module); what cannot be is done here. What it changes in its arguments
        may be lost: it returns all that is wanted.
    here : callable, optional
        The same work as it is done here, such as with somebody who is told of its progress.
    """
    return (here or work) if helper is None else helper.take(work, here or work)


def meanwhile(work: Callable[[], object]) -> None:
    """Let work be done here while a result of another process is waited for; perhaps it never is.

    Parameters
    ----------
    work : callable
        It makes ready what would be made when it is needed, and does nothing where that is done already.
    """
    if helper is not None:
        helper.bridge(work)
