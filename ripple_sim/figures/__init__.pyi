from .atlas_plot import (
    AtlasPainter as AtlasPainter,
    View as View,
    chart_colors as chart_colors,
    check_plot_path as check_plot_path,
    cross as cross,
    plot_atlas as plot_atlas,
    plot_thickness as plot_thickness,
    squares as squares,
    texel_stretch as texel_stretch,
)
from .mode_plot import ModePainter as ModePainter, plot_modes as plot_modes
