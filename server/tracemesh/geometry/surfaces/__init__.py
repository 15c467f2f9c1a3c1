"""From a curve network to a surface (thesis chapter 4)."""
