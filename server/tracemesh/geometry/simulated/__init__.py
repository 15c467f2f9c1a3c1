"""Shapes that are known exactly, and a device that scans them."""
