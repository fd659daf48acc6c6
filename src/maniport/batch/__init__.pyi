from maniport.batch.run import Batch as Batch
from maniport.batch.run import transfer_batch as transfer_batch
