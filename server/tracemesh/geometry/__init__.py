"""The numerical kernel: arrays in, arrays out; nothing of files, networks or the web.

`scan`, `network` and `mesh` are what the parts hand to each other: `sensing` makes frames and distances of a device's
numbers, `curves` makes a network of a scan, `nodes` finds nodes that nobody marked, `surfaces` spans a mesh over a
network; `simulated` scans known shapes, `comparison` measures against the truth.
"""
