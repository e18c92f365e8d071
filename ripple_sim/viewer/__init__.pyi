from .choices import Choices as Choices
from .controls import (
    CONTROLS as CONTROLS,
    MOUSE as MOUSE,
    help_text as help_text,
    level as level,
)
from .loop_view import LoopView as LoopView, view as view
from .opening import (
    BALLS as BALLS,
    FLIGHT as FLIGHT,
    Balls as Balls,
    Opened as Opened,
    add_balls as add_balls,
    display_problem as display_problem,
    open_scene as open_scene,
    opened as opened,
    poke_strength as poke_strength,
)
from .page_server import PageServer as PageServer, served as served, show as show
from .page_view import PageView as PageView, view_of as view_of
from .pages import ALL_TARGETS as ALL_TARGETS, Command as Command, Pages as Pages
from .passive import RippleViewer as RippleViewer, launch_passive as launch_passive
from .recorder import Recorder as Recorder
from .saved_scene import moved_camera as moved_camera, save_scene as save_scene
from .session import OPERATORS as OPERATORS, SLIDERS as SLIDERS, Session as Session
from .stage import (
    BACKGROUND as BACKGROUND,
    add_floor as add_floor,
    geom_mesh as geom_mesh,
    is_endless as is_endless,
)
from .window import (
    Window as Window,
    benchmark as benchmark,
    check_display as check_display,
    run as run,
)
