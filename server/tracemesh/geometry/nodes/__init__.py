"""Nodes that nobody marked, found from the curves' shapes."""
