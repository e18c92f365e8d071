from .exporter import (
    Exporter as Exporter,
    export_scene as export_scene,
    scene_source as scene_source,
)
from .moving_mesh import MovingMesh as MovingMesh
from .options import ExportOptions as ExportOptions
from .page_coding import (
    packed as packed,
    parents_of as parents_of,
    quantised as quantised,
    residuals as residuals,
)
from .place import (
    check_export as check_export,
    check_options as check_options,
    ending_of as ending_of,
)
from .renderer import RippleRenderer as RippleRenderer
from .source import Source as Source
from .tables import COLUMNS as COLUMNS, HEADER as HEADER, rows as rows
from .usd import UsdWriter as UsdWriter
from .visuals import mean_color as mean_color
