"""Measures tracemesh on data with known truth, beside the thesis and other packages: `python -m benchmarks`."""
