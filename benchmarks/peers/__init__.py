"""The same tasks with other libraries."""
