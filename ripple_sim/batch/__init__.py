"""Batches: many scenes by one plan, each varied by its own seed, made by many workers, resumed after any kill."""
