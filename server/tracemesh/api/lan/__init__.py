"""Serving a local network over HTTPS: a small authority, certificates, and help for phones."""
