from .main import COMMANDS as COMMANDS, parse as parse
from .render import (
    DropCommand as DropCommand,
    RenderCommand as RenderCommand,
    ViewCommand as ViewCommand,
    frame_progress as frame_progress,
)
