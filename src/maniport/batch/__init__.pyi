from maniport.batch.inputs import Clip as Clip
from maniport.batch.packed import Merged as Merged
from maniport.batch.packed import PackedDataset as PackedDataset
from maniport.batch.run import Batch as Batch
from maniport.batch.run import transfer_batch as transfer_batch
from maniport.batch.shards import Shard as Shard
from maniport.batch.shards import read_list as read_list
