from .context import (
    GLContext as GLContext,
    select_device as select_device,
    shared_context as shared_context,
)
from .creation import (
    DRAWING_THREADS as DRAWING_THREADS,
    create_context as create_context,
    is_software as is_software,
)
from .current import (
    current_context as current_context,
    load_egl as load_egl,
)
from .shader_text import load_shader as load_shader
