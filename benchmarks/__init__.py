"""Computing times of maniport relative to other libraries; run ``python -m benchmarks``."""
