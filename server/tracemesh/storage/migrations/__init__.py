"""Schema migrations, run at start; a released one is never edited."""
