"""MuJoCo models that tests of several rooms share."""

import mujoco
import numpy as np

from ripple_sim import make_collidable
from ripple_sim.scenes.shapes import limbed

BALL = (
    '<body name="ball" pos="{}"><freejoint/><geom name="ball" type="sphere" size="0.05" '
    'mass="0.3"/></body>'
)


def vector(values: np.ndarray) -> str:
    return " ".join(f"{x:.6g}" for x in np.ravel(values))


def mesh_asset(name: str, V: np.ndarray, F: np.ndarray, attributes: str = "") -> str:
    return (
        f'<mesh name="{name}" vertex="{vector(V)}" face="{" ".join(map(str, F.ravel()))}" '
        f"{attributes}/>"
    )


def limbed_asset(attributes: str = "") -> str:
    """An animal of 0.9 m with four legs and a saddle."""
    return mesh_asset("limbed", *limbed(0.03), attributes)


def model_of(worldbody: str, asset: str = "", option: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="degree"/>
        <option timestep="0.001" sdf_initpoints="10" {option}/>
        <default><geom solref="0.01 0.3"/></default>
        <asset>{asset}</asset><worldbody>{worldbody}</worldbody></mujoco>"""
    )


def posed(xml: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model and its data at the beginning."""
    model = mujoco.MjModel.from_xml_string(xml)
    return model, forwarded(model)


def forwarded(model: mujoco.MjModel) -> mujoco.MjData:
    """Data at the beginning, with all that follows from it."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def mesh_spec(
    shape: tuple, joint: str | None = None, route: str | None = "flex", **geom: object
) -> mujoco.MjSpec:
    """A mesh geom "target" on a body "base" of its own, which may move."""
    V, F = shape
    spec = mujoco.MjSpec()
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    body = spec.worldbody.add_body(name="base", pos=[0.1, -0.2, 0.3], quat=[0.8, 0.0, 0.6, 0.0])
    if joint == "free":
        body.add_freejoint()
    body.add_geom(
        name="target", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="shape", mass=3.0, **geom
    )
    if route is not None:
        make_collidable(spec, "target", route)
    return spec


def add_ball(spec: mujoco.MjSpec, name: str, pos: list[float], **geom: object) -> None:
    body = spec.worldbody.add_body(name=name, pos=pos)
    body.add_freejoint()
    body.add_geom(**{"name": name, "size": [0.04, 0, 0], "mass": 0.2, **geom})
