"""Tuples in a MuJoCo model that say what its user sensors measure on rippling surfaces.

`add_sensor` and `add_height_map` add a sensor and a `<tuple>`, whose first two elements name the
sensor and the target. Its name begins with `SENSOR_TUPLE` or `MAP_TUPLE`; `MjSpec.attach` may put a
prefix before that.
"""

from __future__ import annotations

from collections.abc import Iterator

import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .hooks import watch_rollouts
from .ids import TargetId, geom_id, target_of_flex, target_of_skin

_OBJECT = mujoco.mjtObj

# Beginnings of the names of the tuples.
SENSOR_TUPLE = "ripple-sim sensor "
MAP_TUPLE = "ripple-sim height map "

# Types of objects that may ripple.
TARGET_TYPES = (_OBJECT.mjOBJ_GEOM, _OBJECT.mjOBJ_FLEX, _OBJECT.mjOBJ_SKIN)


def add_tuple(
    spec: mujoco.MjSpec,
    name: str,
    types: list[mujoco.mjtObj],
    objects: list[str],
    numbers: list[float],
) -> None:
    """Add a tuple; from now on rollouts of models that have one warn."""
    spec.add_tuple(name=name, objtype=types, objname=objects, objprm=numbers)
    watch_rollouts(_rollout_warning)


def tuples_of(model: mujoco.MjModel, beginning: str) -> Iterator[tuple[str, slice]]:
    """Names of the tuples with a beginning, and the places of their elements.

    From now on rollouts of models that have one warn.
    """
    for i in range(model.ntuple):
        name = model.tuple(i).name
        if beginning in name:
            watch_rollouts(_rollout_warning)
            first = int(model.tuple_adr[i])
            yield name, slice(first, first + int(model.tuple_size[i]))


def names_sensor_and_target(model: mujoco.MjModel, elements: slice) -> bool:
    """Whether the first two elements of a tuple are a user sensor and what may ripple."""
    types = model.tuple_objtype[elements].tolist()
    if len(types) < 2 or types[0] != _OBJECT.mjOBJ_SENSOR or types[1] not in TARGET_TYPES:
        return False
    sensor = model.tuple_objid[elements][0]
    return bool(model.sensor_type[sensor] == mujoco.mjtSensor.mjSENS_USER)


def _rollout_warning(model: mujoco.MjModel) -> str:
    """Warning before a rollout of a model with sensors on rippling surfaces; "" without them."""
    places = [*tuples_of(model, SENSOR_TUPLE), *tuples_of(model, MAP_TUPLE)]
    sensors = [int(model.tuple_objid[elements][0]) for _, elements in places]
    names = ", ".join(repr(model.sensor(sensor).name) for sensor in sensors)
    if not names:
        return ""
    return (
        f"mujoco.rollout does not step the waves: its sensordata has no samples of {names}; step "
        "with Ripples.mj_step where you need them"
    )


def require_free_name(spec: mujoco.MjSpec, name: str) -> None:
    """Raise `SceneError` unless a specification can take a sensor of this name."""
    if not isinstance(spec, mujoco.MjSpec):
        raise SceneError(f"spec must be a mujoco.MjSpec, got {shown(spec)}")
    if not isinstance(name, str) or not name or spec.sensor(name) is not None:
        raise SceneError(
            "the name of a sensor must be a str that no other sensor of the specification has, got "
            f"{shown(name)}"
        )


def type_of_target(spec: mujoco.MjSpec, name: str) -> mujoco.mjtObj:
    """What a name is: a geom, a flex or a skin."""
    if isinstance(name, str) and name:
        if spec.geom(name) is not None:
            return _OBJECT.mjOBJ_GEOM
        if spec.flex(name) is not None:
            return _OBJECT.mjOBJ_FLEX
        if spec.skin(name) is not None:
            return _OBJECT.mjOBJ_SKIN
    names = ", ".join(repr(other.name) for other in spec.geoms if other.name)
    raise SceneError(
        f"the specification has no geom, flex or skin {shown(name)}; its named geoms are "
        f"{names or 'none'}"
    )


def target_with_id(model: mujoco.MjModel, kind: int, number: int) -> TargetId:
    """Target id of the geom, flex or skin with an id."""
    if kind == _OBJECT.mjOBJ_FLEX:
        return target_of_flex(model, number)
    if kind == _OBJECT.mjOBJ_SKIN:
        return target_of_skin(model, number)
    return geom_id(number)
