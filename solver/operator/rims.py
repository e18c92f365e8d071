"""What waves do at the rims of an open surface."""

# They come back upright from a free rim, inverted from a fixed one.
RIMS = ("free", "fixed")
