"""From a scan to a curve network (thesis chapter 3)."""
