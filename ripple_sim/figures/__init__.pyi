from .atlas_painter import (
    AtlasPainter as AtlasPainter,
    View as View,
    cross as cross,
    squares as squares,
)
from .atlas_plot import (
    chart_colors as chart_colors,
    plot_atlas as plot_atlas,
    texel_stretch as texel_stretch,
)
from .figure_file import check_plot_path as check_plot_path
from .mode_plot import ModePainter as ModePainter, plot_modes as plot_modes
from .thickness_plot import plot_thickness as plot_thickness
