"""Small YAML files that people write by hand: limits of joints, boxes around a robot."""

import os
from collections.abc import Collection, Hashable
from pathlib import Path
from typing import Any

import yaml

from maniport.bounds import SETTINGS_BYTES, read_whole
from maniport.errors import FileFormatError, nearest_first

SUFFIXES = (".yaml", ".yml", ".json")


def read_settings(path: str | os.PathLike[str], keys: Collection[str]) -> dict[str, Any]:
    """Read a YAML or JSON file that holds one mapping."""
    file = Path(path)
    text = read_whole(file, SUFFIXES, SETTINGS_BYTES)
    try:
        content = yaml.load(text.decode("utf-8-sig"), Loader=_StrictLoader)
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{file}: not a text file: {error.reason} at byte {error.start}") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" in line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise FileFormatError(f"{file}: not readable as YAML{where}: {error.problem}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{file}: not readable as YAML: {error}") from None
    return require_mapping(content, keys, str(file))


def require_mapping(content: Any, keys: Collection[str], where: str) -> dict[str, Any]:
    """Require a mapping that has no keys but some; `where` says what it is, such as ``"limits.yaml: joints"``."""
    allowed = ", ".join(keys)
    if not isinstance(content, dict):
        kind = "nothing" if content is None else type(content).__name__
        raise FileFormatError(f"{where} must be a mapping with the keys {allowed}; found {kind}")
    for key in content:
        if key not in keys:
            near = ", ".join(nearest_first(key, keys))
            raise FileFormatError(f"{where}: unknown key {key!r}; allowed are, nearest first: {near}")
    return content


class _StrictLoader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML is untyped
    """Refuses aliases, which make a small file grow without bounds, and keys that stand twice."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise yaml.composer.ComposerError(None, None, f"aliases (*{event.anchor}) are not read", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                problem = f"the key {key!r} stands twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return mapping
