"""Reports of results: what the pages of `maniport.viewing.report` show of a transfer, a motion, the paper again."""

from maniport.reporting.execution_report import of_execution
from maniport.reporting.paper_report import of_reproduction
from maniport.reporting.transfer_report import of_transfer

__all__ = ["of_execution", "of_reproduction", "of_transfer"]
