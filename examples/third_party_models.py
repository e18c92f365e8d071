"""Models of other packages with one geom that ripples, and what each of them needs for it.

    pip install --no-deps gymnasium dm_control gymnasium-robotics metaworld robosuite playground
    python examples/third_party_models.py [out/third_party_models]

Their code is not run: an MJCF is read from each package, a ball hits the geom, and the model is
stepped for half a second and drawn. Prints the table of docs/third-party-models.md, and makes a
picture of each. A package that is not installed is skipped, with a line.
"""

import importlib.util
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from PIL import Image

from ripple_sim import Camera, Material, RippleRenderer, Ripples
from ripple_sim.errors import RippleError, RippleWarning

DURATION = 0.5  # s
SPEED = 2.0  # of the ball [m/s]
DRAWN = 0.06  # after the first hit [s]


# what warnings have in them, and what the table says of them
TOLD = {
    "the integrator RK4": "integrator RK4",
    "collides as its convex hull": "collides as its convex hull",
    "collides as": "collision geoms off the surface",
    "shows hits of the lightest body": "heavier bodies are eased",
    "higher than a pixel": "lower than a pixel",
    "too high": "waves too high",
    "too steep": "waves too steep",
    "would pass through": "too fast for the time step",
    "turned over": "triangles turned over",
}


class Case(NamedTuple):
    """A model, its targets, where the ball comes from, and groups of geoms not drawn."""

    package: str
    path: str
    geom: str
    side: tuple[int, int, int] = (0, 0, 1)
    hidden: tuple[int, ...] = ()

    @property
    def needed(self) -> str:
        return "".join(f"`option.geomgroup[{group}] = 0`" for group in self.hidden)

    @property
    def azimuth(self) -> float:
        """Of a camera on the ball's side [degrees]."""
        x, y, _ = self.side
        return float(np.degrees(np.arctan2(-y, -x))) + 40.0 if x or y else 130.0


# the group of geoms that collide, where it is drawn and the geoms lie over the visible one
HERE = (0,)
GYM = "gymnasium", "envs/mujoco/assets"
HANDS = "gymnasium_robotics", "envs/assets"
SAWYER = "metaworld", "assets/sawyer_xyz"
ROBOTS = "robosuite", "models/assets"
CASES = [
    Case(GYM[0], f"{GYM[1]}/ant.xml", "torso_geom"),
    Case(GYM[0], f"{GYM[1]}/humanoid.xml", "torso1", (1, 0, 0)),
    Case(GYM[0], f"{GYM[1]}/half_cheetah.xml", "torso"),
    Case("dm_control", "suite/quadruped.xml", "torso"),
    Case("dm_control", "suite/manipulator.xml", "ball"),
    Case("dm_control", "suite/dog.xml", "skin"),
    Case("dm_control", "locomotion/soccer/assets/boxhead/boxhead.xml", "shell", (0, -1, 0)),
    Case("dm_control", "locomotion/walkers/assets/fruitfly_v2/floor.xml", "thorax"),
    Case(HANDS[0], f"{HANDS[1]}/fetch/pick_and_place.xml", "object0"),
    Case(HANDS[0], f"{HANDS[1]}/fetch/slide.xml", "robot0:base_link"),
    Case(HANDS[0], f"{HANDS[1]}/hand/manipulate_egg.xml", "object"),
    Case(HANDS[0], f"{HANDS[1]}/hand/manipulate_block.xml", "robot0:V_palm"),
    Case(HANDS[0], f"{HANDS[1]}/adroit_hand/adroit_hammer.xml", "board"),
    Case(
        HANDS[0],
        f"{HANDS[1]}/kitchen_franka/kitchen_assets/kitchen_env_model.xml",
        "panda0_link4/0",
    ),
    Case(SAWYER[0], f"{SAWYER[1]}/sawyer_coffee.xml", "mug"),
    Case(SAWYER[0], f"{SAWYER[1]}/sawyer_soccer.xml", "soccer_ball1/0"),
    Case(ROBOTS[0], f"{ROBOTS[1]}/robots/panda/robot.xml", "link7/7", hidden=HERE),
    Case(ROBOTS[0], f"{ROBOTS[1]}/robots/iiwa/robot.xml", "link_4_visual", (1, 0, 0), HERE),
    Case(ROBOTS[0], f"{ROBOTS[1]}/robots/spot/robot.xml", "body/1", hidden=HERE),
    Case(
        ROBOTS[0], f"{ROBOTS[1]}/grippers/robotiq_gripper_140.xml", "hand_visual", (0, 1, 0), HERE
    ),
    Case(ROBOTS[0], f"{ROBOTS[1]}/objects/bottle.xml", "object/0", (1, 0, 0), HERE),
    Case(ROBOTS[0], f"{ROBOTS[1]}/objects/can.xml", "object/0", (1, 0, 0)),
    Case(
        "mujoco_playground",
        "_src/manipulation/leap_hand/xmls/reorientation_cube.xml",
        "cube/0",
        (1, 0, 0),
    ),
]


def begun(model: mujoco.MjModel) -> mujoco.MjData:
    """The state of the first keyframe, where the model has one."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def box_of(model: mujoco.MjModel, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Middle of what ripples, and half its extents along the axes of the world [m]."""
    data = begun(model)
    if name not in (model.skin(each).name for each in range(model.nskin)):
        body, _, index = name.partition("/")
        geom = model.body(body).geomadr[0] + int(index) if index else model.geom(name).id
        rotation = data.geom_xmat[geom].reshape(3, 3)
        box = model.geom_aabb[geom]
        return data.geom_xpos[geom] + rotation @ box[:3], np.abs(rotation) @ box[3:]
    places = data.xpos[model.skin_bonebodyid]
    return (places.min(axis=0) + places.max(axis=0)) / 2, np.ptp(places, axis=0) / 2


def with_ball(spec: mujoco.MjSpec, middle: np.ndarray, half: np.ndarray, side: np.ndarray) -> None:
    """Put a ball beside a box. The model's defaults may be anything, so all is said."""
    radius = 0.2 * half.max()
    mass = 4000 * radius**3
    ball = spec.worldbody.add_body(name="our ball", pos=middle + side * (half + 2 * radius))
    ball.mass = mass
    ball.inertia = np.full(3, 0.4 * mass * radius**2)
    ball.explicitinertial = True
    ball.ipos = np.zeros(3)  # without it the mass is at the origin of the world
    ball.add_freejoint(name="our ball")
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    ball.add_geom(
        type=sphere, size=(radius, 0, 0), contype=1, conaffinity=1, group=1, rgba=(0.8, 0.3, 0.2, 1)
    )


def run(case: Case, model: mujoco.MjModel, camera: Camera) -> tuple[float, float, np.ndarray]:
    """Impulse on the geom [N s], its highest ripple [m], and a frame just after the first hit."""
    data = begun(model)
    impulse = 0.0
    highest = 0.0
    first_hit = np.inf  # [s]
    frame = None
    data.joint("our ball").qvel[:3] = -SPEED * np.array(case.side)
    option = mujoco.MjvOption()
    option.geomgroup[list(case.hidden)] = 0
    ripples = Ripples(model, {case.geom: Material()})  # the one line
    with RippleRenderer(model, ripples, 360, 480, lighting="auto") as renderer:
        while data.time < DURATION:
            ripples.mj_step(data)
            impulse += sum(hit.impulse for hit in ripples.last_impulses)
            highest = max(highest, float(np.abs(ripples[case.geom].height).max()))
            if impulse > 0:
                first_hit = min(first_hit, data.time)
            is_last = data.time + model.opt.timestep > DURATION
            if frame is None and (data.time > first_hit + DRAWN or is_last):
                renderer.update_scene(data, camera, option)
                frame = renderer.render()
    return impulse, highest, frame


def shortly(message: str) -> str:
    """A warning in a few words, as far as it is one of those above."""
    return next((short for words, short in TOLD.items() if words in message), message)


def tried(case: Case, file: Path, picture: Path) -> str:
    """A row of the table."""
    spec = mujoco.MjSpec.from_file(str(file))
    middle, half = box_of(spec.compile(), case.geom)
    with_ball(spec, middle, half, np.array(case.side))
    model = spec.compile()
    size = 2 * float(half.max())
    camera = Camera(
        lookat=tuple(middle), distance=2.5 * size, azimuth=case.azimuth, elevation=-30.0
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RippleWarning)
        impulse, highest, frame = run(case, model, camera)
    Image.fromarray(frame).save(picture)
    messages = [str(each.message) for each in caught if issubclass(each.category, RippleWarning)]
    told = "; ".join(dict.fromkeys(map(shortly, messages))) or "-"
    return (
        f"| `{case.geom}` | {case.needed or '-'} | {impulse:.2g} | {highest / size:.4f} | {told} |"
    )


def main(folder: str = "out/third_party_models") -> None:
    Path(folder).mkdir(parents=True, exist_ok=True)
    print(
        "| package | model | geom | needed beside the line | N s | highest over size | warned of |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    missing = set()
    for case in CASES:
        package = importlib.util.find_spec(case.package)
        if package is None or not package.submodule_search_locations:
            missing.add(case.package)
            continue
        file = Path(package.submodule_search_locations[0]) / case.path
        name = "/".join(file.parts[-2:])
        picture = Path(folder) / f"{name} {case.geom}.png".replace("/", "_").replace(":", "_")
        try:
            row = tried(case, file, picture)
        except RippleError as error:
            row = f"| `{case.geom}` | refused | | | {error} |"
        print(f"| {case.package} | {name} {row}", flush=True)
    for package in sorted(missing):
        print(f"skipped: {package} is not installed")


if __name__ == "__main__":
    main(*sys.argv[1:])
