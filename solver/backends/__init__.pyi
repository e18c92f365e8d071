from .backend import Backend as Backend, TexelLoad as TexelLoad
from .backend_speed import measured as measured
from .choice import auto_backend as auto_backend, make_backend as make_backend
from .cpu import CPUBackend as CPUBackend
from .gl_fields import (
    DeviceField as DeviceField,
    FieldLayout as FieldLayout,
    TexelList as TexelList,
    bind_buffers as bind_buffers,
)
from .row_layout import RowLayout as RowLayout
from .step_kernels import advance as advance
