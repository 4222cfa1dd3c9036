"""Sweeps: many runs of one scene with other values and seeds, on all cores or on a cluster, and what they have in common.

`tumble.sweep` runs one; `grid`, `zipped`, `latin`, `sobol` and `table` in `tumble.sweeps.design` say which values. See
docs/sweeps.md.
"""
