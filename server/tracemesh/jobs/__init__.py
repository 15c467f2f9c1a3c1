"""Reconstruction jobs: the table is the truth, an executor is only where the work runs."""
