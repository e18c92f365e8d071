from .batch.plan import read_plan as read_plan
from .batch.report import load_batch as load_batch
from .batch.run import RunOptions as RunOptions, run_batch as run_batch
from .coupling.colliders import make_collidable as make_collidable
from .coupling.map_sensors import add_height_map as add_height_map
from .coupling.ripples import Impulse as Impulse, Ripples as Ripples
from .coupling.target import Target as Target
from .coupling.user_sensors import add_sensor as add_sensor
from .errors import RippleWarning as RippleWarning
from .export.exporter import Exporter as Exporter, export_scene as export_scene
from .export.options import ExportOptions as ExportOptions
from .export.renderer import RippleRenderer as RippleRenderer
from .figures.atlas_plot import plot_atlas as plot_atlas
from .figures.mode_plot import plot_modes as plot_modes
from .render import Camera as Camera
from .scene.drop import drop_scene as drop_scene
from .scene.loading import load_scene as load_scene
from .scene.scene import Scene as Scene
from .simulation import Simulation as Simulation
from .solver import Material as Material, RippleError as RippleError
from .video.options import VideoOptions as VideoOptions
from .video.render_video import render_video as render_video
from .viewer.loop_view import view as view
from .viewer.passive import launch_passive as launch_passive

__version__: str
