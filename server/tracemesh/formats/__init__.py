"""Files in and out. Axis and unit changes happen here, nowhere else."""
