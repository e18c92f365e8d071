"""A run as one page that plays it in any browser."""
