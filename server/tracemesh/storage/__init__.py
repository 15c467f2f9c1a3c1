"""Sessions, recordings and artifacts at rest."""
