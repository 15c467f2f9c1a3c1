"""Pictures for the pages of docs/algorithms, drawn from what the kernel computes: `python -m benchmarks.pictures`."""
