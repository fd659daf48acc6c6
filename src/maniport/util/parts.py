"""Files that are written in parts, one after the other."""

from types import TracebackType
from typing import Self


class WrittenInParts:
    """Base of context managers that write files: `finish` ends them unless an error was raised, `close` closes them."""

    def finish(self) -> None:
        """Write what is left."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the files."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.close()
