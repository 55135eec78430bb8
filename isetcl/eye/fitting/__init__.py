"""Eyes fitted to measurements."""
