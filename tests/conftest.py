"""Keep the tests' atlases out of the user's cache."""

import os
import tempfile

_cache = tempfile.TemporaryDirectory(prefix="ripple-sim-tests-")
os.environ["XDG_CACHE_HOME"] = _cache.name
