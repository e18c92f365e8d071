"""Where the program starts: signals follow one rule before anything else is imported."""

from .signals import end_at_once

end_at_once()

from .main import main  # noqa: E402

__all__ = ["main"]
