"""The numerical kernel: arrays in, arrays out; nothing of files, networks or the web."""
