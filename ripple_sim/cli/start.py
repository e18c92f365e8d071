"""Where the program starts: signals follow one rule before anything else is imported."""

import atexit

from .signals import end_at_once, finish_undisturbed

end_at_once()
atexit.register(finish_undisturbed)  # the first, so that it is called after all others

from .main import main  # noqa: E402

__all__ = ["main"]
