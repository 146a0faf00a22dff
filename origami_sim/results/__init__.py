"""Run folders: what is kept of a run, also where the disk is full, and what is printed for machines."""
