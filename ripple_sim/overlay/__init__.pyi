from .color_map import (
    SIZE as SIZE,
    color_table as color_table,
    colors as colors,
    lab_to_srgb as lab_to_srgb,
)
from .layout import Layout as Layout
from .marks import MEMORY as MEMORY, ContactMarks as ContactMarks, Mark as Mark
from .notes import (
    MOST_POINTS as MOST_POINTS,
    Notebook as Notebook,
    Notes as Notes,
    curve as curve,
    grid_spacing as grid_spacing,
    magnitude as magnitude,
)
from .operators import TITLES as TITLES, compared_operators as compared_operators
from .painter import Painter as Painter
from .panels import arrow_key as arrow_key, color_bar as color_bar, label as label
from .placed_marks import (
    Projection as Projection,
    draw_marks as draw_marks,
    place_marks as place_marks,
)
from .plots import EnergyPlot as EnergyPlot
from .scales import Limit as Limit, number as number, readable as readable, round_up as round_up
from .sprite import Sprite as Sprite, draw_arrow as draw_arrow, text_width as text_width
