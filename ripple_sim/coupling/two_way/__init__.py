"""How moving surfaces push back on bodies."""
