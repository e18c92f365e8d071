"""What this machine offers, and what keeps it from rendering."""
