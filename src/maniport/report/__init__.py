"""Reports of results: metrics, their text, JSON and page renderings, and figures."""

from maniport.report.describe import report_of
from maniport.report.render import as_markdown, as_numbers
from maniport.report.values import Metric, Report

__all__ = ["Metric", "Report", "as_markdown", "as_numbers", "report_of"]
