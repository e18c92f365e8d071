from .controls import (
    CONTROLS as CONTROLS,
    MOUSE as MOUSE,
    Recorder as Recorder,
    help_text as help_text,
    level as level,
)
from .opening import (
    BALLS as BALLS,
    FLIGHT as FLIGHT,
    Balls as Balls,
    add_balls as add_balls,
    display_problem as display_problem,
    open_scene as open_scene,
    poke_strength as poke_strength,
)
from .passive import RippleViewer as RippleViewer, launch_passive as launch_passive
from .session import OPERATORS as OPERATORS, SLIDERS as SLIDERS, Session as Session
from .stage import (
    BACKGROUND as BACKGROUND,
    add_floor as add_floor,
    geom_mesh as geom_mesh,
    is_endless as is_endless,
)
from .web import check_web as check_web, serve as serve
from .window import (
    Window as Window,
    benchmark as benchmark,
    check_display as check_display,
    run as run,
)
