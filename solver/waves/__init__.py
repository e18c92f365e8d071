"""Waves on an atlas: heights and velocities, the loads that raise them, and the solver that steps them."""
