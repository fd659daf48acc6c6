"""Many recordings on many robots: in processes or on a cluster, going on where it was, with a table of all measures."""

from maniport.batch.run import Batch, transfer_batch

__all__ = ["Batch", "transfer_batch"]
