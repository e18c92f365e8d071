"""`add_sensor`: sensors on rippling surfaces, as user sensors of a MuJoCo model.

A sensor is two things in the specification, so that it outlives XML and `MjSpec.attach`:

- `<user objtype="site" needstage="none" dim="..."/>`. MuJoCo writes zeros to user sensors of the
  stages pos, vel and acc in each step. Of the stage none it leaves them alone.
- A `<tuple>` that names this sensor, the target and the site. Its three numbers are the rate, the
  kind's index in `KINDS`, and the thickness, 0 for none.
"""

from __future__ import annotations

import dataclasses

import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown
from ripple_sim.solver.waves.sensor import KINDS, check_sensor

from .geoms import target_name
from .ids import TargetId
from .sensor_tuples import (
    SENSOR_TUPLE,
    add_tuple,
    names_sensor_and_target,
    require_free_name,
    target_with_id,
    tuples_of,
    type_of_target,
)

_OBJECT = mujoco.mjtObj

# Largest number of samples in a time step; a sensor of 48,000 samples a second has 48 in 1 ms.
_MAX_SAMPLES = 100_000

# Share of a sample by which the samples in a time step may differ from a whole number.
_ROUND_OFF = 1e-6


@dataclasses.dataclass(frozen=True)
class UserSensor:
    """A sensor that `add_sensor` has added to a model.

    Attributes
    ----------
    name : str
    target : TargetId
    geom : str
        Name of the target.
    site : str
    kind : str
    rate : float
        Samples a second [1/s].
    thickness : float, optional
        [m]
    begin, end : int
        Its place in `data.sensordata`.
    """

    name: str
    target: TargetId
    geom: str
    site: str
    kind: str
    rate: float
    thickness: float | None
    begin: int
    end: int


def add_sensor(
    spec: mujoco.MjSpec,
    name: str,
    geom: str,
    site: str,
    kind: str = "acceleration",
    rate: float = 8000.0,
    thickness: float | None = None,
) -> mujoco.MjsSensor:
    """Add a sensor on a rippling surface, which `Ripples` then writes to `data.sensordata`.

    After each `Ripples.step` and `Ripples.mj_step`, `data.sensor(name).data` has the samples of the
    time step, in order. They are those of `ripples[geom].sensor(site, kind, rate)`, in one unbroken
    row from step to step, late by its `latency`, rounded up to whole samples, and 0 before that.
    They stay until the next step, and a reset sets them to 0. Steps that `Ripples` does not see,
    such as those of `mujoco.rollout`, leave them as they are; a rollout gives one warning.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled. Set its time step first.
    name : str
        Name of the sensor.
    geom : str
        Name of the geom, flex or skin that ripples.
    site : str
        Name of a site on the geom's body, or on one welded to it; the nearest point of the surface
        is taken.
    kind : str
        As for `WaveSolver.sensor`.
    rate : float
        Samples a second [1/s]; a whole number of samples in a time step.
    thickness : float, optional
        As for `WaveSolver.sensor` [m].

    Returns
    -------
    mujoco.MjsSensor

    Raises
    ------
    SceneError
        For an unknown geom or site, a name that is taken, or a rate that does not suit the time
        step.
    SolverError
        For an invalid kind, rate or thickness.
    """
    require_free_name(spec, name)
    check_sensor(kind, rate, thickness)
    target_type = type_of_target(spec, geom)
    if not isinstance(site, str) or spec.site(site) is None:
        sites = ", ".join(repr(other.name) for other in spec.sites if other.name)
        raise SceneError(
            f"the specification has no site {shown(site)}; its named sites are {sites or 'none'}"
        )
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_USER,
        objtype=_OBJECT.mjOBJ_SITE,
        objname=site,
        dim=_samples_in_step(rate, spec.option.timestep),
        datatype=mujoco.mjtDataType.mjDATATYPE_REAL,
        needstage=mujoco.mjtStage.mjSTAGE_NONE,
    )
    add_tuple(
        spec,
        SENSOR_TUPLE + name,
        [_OBJECT.mjOBJ_SENSOR, target_type, _OBJECT.mjOBJ_SITE],
        [name, geom, site],
        [rate, KINDS.index(kind), thickness or 0.0],
    )
    return sensor


def user_sensors(model: mujoco.MjModel) -> list[UserSensor]:
    """The sensors that `add_sensor` has added to a model.

    Raises `SceneError` if a sensor's rate no longer suits the model's time step, or its tuple has
    been changed.
    """
    sensors = []
    for name, elements in tuples_of(model, SENSOR_TUPLE):
        if not _describes_sensor(model, elements):
            raise SceneError(
                f"tuple {name!r} must have a user sensor, a geom, flex or skin, and a site, with "
                "rate, kind and thickness, as add_sensor makes it; give tuples of your own another "
                "name"
            )
        sensors.append(_user_sensor(model, elements))
    return sensors


def _describes_sensor(model: mujoco.MjModel, elements: slice) -> bool:
    """Whether the elements of a tuple are as `add_sensor` makes them."""
    types = model.tuple_objtype[elements].tolist()
    if not names_sensor_and_target(model, elements):
        return False
    if len(types) != 3 or types[2] != _OBJECT.mjOBJ_SITE:
        return False
    rate, kind_index, _ = model.tuple_objprm[elements]
    return bool(rate > 0 and kind_index in range(len(KINDS)))


def _user_sensor(model: mujoco.MjModel, elements: slice) -> UserSensor:
    """The sensor that the elements of a tuple describe."""
    sensor_id, target_id, site_id = (int(number) for number in model.tuple_objid[elements])
    rate, kind_index, thickness = (float(number) for number in model.tuple_objprm[elements])
    target = target_with_id(model, int(model.tuple_objtype[elements][1]), target_id)
    sensor = UserSensor(
        name=model.sensor(sensor_id).name,
        target=target,
        geom=target_name(model, target),
        site=model.site(site_id).name,
        kind=KINDS[int(kind_index)],
        rate=rate,
        thickness=thickness or None,
        begin=int(model.sensor_adr[sensor_id]),
        end=int(model.sensor_adr[sensor_id] + model.sensor_dim[sensor_id]),
    )
    samples = rate * model.opt.timestep
    if abs(samples - (sensor.end - sensor.begin)) > _ROUND_OFF * max(samples, 1.0):
        raise SceneError(
            f"sensor {sensor.name!r} has room for {sensor.end - sensor.begin} samples in a time "
            f"step, but {rate:g} samples a second are {samples:g} in the model's time step of "
            f"{model.opt.timestep:g} s: set the time step before add_sensor, and keep it"
        )
    return sensor


def _samples_in_step(rate: float, timestep: float) -> int:
    """Samples in a time step [s]; raises `SceneError` if they are no whole number."""
    samples = rate * timestep
    count = round(samples)
    if not 1 <= count <= _MAX_SAMPLES or abs(samples - count) > _ROUND_OFF * count:
        nearest = min(max(count, 1), _MAX_SAMPLES) / timestep
        raise SceneError(
            f"sensor rate must give a whole number of samples in a time step, 1 to {_MAX_SAMPLES}: "
            f"got {rate:g} samples a second, which are {samples:g} in {timestep:g} s; take "
            f"{nearest:g}, or another time step"
        )
    return count
