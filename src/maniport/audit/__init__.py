"""Audits of datasets: whether a robot can execute the motions, and how close they come to its limits."""

from maniport.audit.audit import Audit, AuditOptions, audit_dataset
from maniport.audit.checks import KINDS

__all__ = ["KINDS", "Audit", "AuditOptions", "audit_dataset"]
