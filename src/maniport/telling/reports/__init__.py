"""Reports of results: what the pages of `maniport.telling.page` show of a transfer, a motion, the paper again."""

from maniport.telling.reports.execution_report import of_execution
from maniport.telling.reports.paper_report import of_reproduction
from maniport.telling.reports.transfer_report import of_transfer

__all__ = ["of_execution", "of_reproduction", "of_transfer"]
