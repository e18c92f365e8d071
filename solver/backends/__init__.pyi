from .backend import (
    Backend as Backend,
    auto_backend as auto_backend,
    make_backend as make_backend,
    measured as measured,
)
from .cpu import CPUBackend as CPUBackend, RowLayout as RowLayout
from .gl_fields import (
    DeviceField as DeviceField,
    FieldLayout as FieldLayout,
    TexelList as TexelList,
    bind_buffers as bind_buffers,
)
from .kernels import advance as advance, fill as fill
