from .context import (
    DRAWING_THREADS as DRAWING_THREADS,
    GLContext as GLContext,
    create_context as create_context,
    is_software as is_software,
    load_shader as load_shader,
    select_device as select_device,
    shared_context as shared_context,
)
from .current import (
    current_context as current_context,
    load_egl as load_egl,
)
