"""Former names of `maniport.telling.metrics`, until callers are renamed."""

from maniport.telling.metrics import Metric as Fact
from maniport.telling.metrics import Report as Facts
from maniport.telling.metrics import Section, Table, facts_of, in_axes, warning
from maniport.telling.metrics import describe as told

__all__ = ["Fact", "Facts", "Section", "Table", "facts_of", "in_axes", "told", "warning"]
