"""Devices, real and virtual, behind one protocol."""
