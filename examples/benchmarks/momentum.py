"""What a surface receives against the momentum that its body gains, in cases of every kind.

    python examples/benchmarks/momentum.py [CASE ...]

A plate of 5 kg that can move up and down alone is pushed from above, without gravity: by thrown,
driven, tied, sticky and scripted bodies. All that it gains must be in the impulses that its surface
receives.
"""

import argparse
import dataclasses
from collections.abc import Callable

import mujoco

from ripple_sim import Material, Ripples

MASS = 5.0
STEPS = 400
PLATE = f"""<body name="plate"><joint name="plate" type="slide" axis="0 0 1"/>
    <geom name="target" type="box" size="0.3 0.3 0.05" mass="{MASS}"/></body>"""
BALL = '<geom name="ball" size="0.05" mass="1" {}/>'
FREE = (
    '<body name="ball" pos="0.1 0 0.12"><freejoint name="ball"/><site name="on"/>'
    + BALL
    + "</body>"
)
DRIVEN = (
    '<body name="ball" pos="0.1 0 0.12"><joint name="ball" type="slide" axis="0 0 1"/>'
    + BALL.format("")
    + "</body>"
)
MOCAP = '<body name="hand" mocap="true" pos="0.1 0 {}">{}</body>'


@dataclasses.dataclass(frozen=True)
class Case:
    """What pushes the plate: bodies, elements of the model, options, and a script's steps."""

    bodies: str
    more: str = ""
    option: str = "/>"
    plate: str = PLATE
    script: Callable[[mujoco.MjData], None] = lambda data: None
    speed: float = 0.0
    plate_speed: float = 0.0
    targets: tuple[str, ...] = ("target",)


def lower_hand(data: mujoco.MjData) -> None:
    """Move the mocap body down at 0.3 m/s."""
    data.mocap_pos[0, 2] -= 0.3 * 0.001


def full_power(data: mujoco.MjData) -> None:
    """Switch all actuators on."""
    data.ctrl[:] = 1.0


CASES = {
    "thrown": Case(FREE.format(""), speed=-1.0),
    "thrown, friction in six directions": Case(FREE.format('condim="6"'), speed=-1.0),
    "moved by mocap": Case(MOCAP.format(0.12, BALL.format("")), script=lower_hand),
    "welded to a mocap body": Case(
        FREE.format("") + MOCAP.format(0.12, ""),
        '<equality><weld body1="ball" body2="hand"/></equality>',
        script=lower_hand,
    ),
    "connected to a heavy body": Case(
        FREE.format("")
        + '<body name="heavy" pos="0.1 0 0.5"><joint name="heavy" type="slide" axis="0 0 1"/>'
        + '<geom size="0.1" mass="50" contype="0" conaffinity="0"/></body>',
        '<equality><connect body1="ball" body2="heavy" anchor="0 0 0"/></equality>',
        speed=-1.0,
    ),
    "pressed by a motor": Case(
        DRIVEN, '<actuator><motor joint="ball" gear="-20"/></actuator>', script=full_power
    ),
    "pressed by a position servo": Case(
        DRIVEN, '<actuator><position joint="ball" kp="-200" kv="5"/></actuator>', script=full_power
    ),
    "pulled by a tendon": Case(
        DRIVEN,
        """<tendon><fixed stiffness="300" springlength="-0.3"><joint joint="ball" coef="1"/></fixed>
        </tendon>""",
    ),
    "held by a tendon at its limit": Case(
        FREE.format("") + '<site name="above" pos="0.1 0 0.4"/>',
        """<tendon><spatial limited="true" range="0 0.301"><site site="above"/><site site="on"/>
        </spatial></tendon>""",
        speed=-1.0,
    ),
    "stuck by an adhesion actuator": Case(
        FREE.format('gap="0.01"'),
        '<actuator><adhesion body="ball" ctrlrange="0 1" gain="30"/></actuator>',
        script=full_power,
        speed=-1.0,
    ),
    "stuck by its own adhesion": Case(FREE.format('gap="0.01" adhesion="30"'), speed=-1.0),
    "with margin and gap": Case(FREE.format('margin="0.01" gap="0.02"'), speed=-1.0),
    "as a pair of its own": Case(
        FREE.format('contype="0" conaffinity="0"'),
        (
            '<contact><pair geom1="ball" geom2="target" condim="1" solref="-2000 -20" '
            'margin="0.01"/></contact>'
        ),
        speed=-1.0,
    ),
    "contact parameters overridden": Case(
        FREE.format(""),
        option='o_solref="-3000 -30" o_margin="0.005"><flag override="enable"/></option>',
        speed=-1.0,
    ),
    "target in a chain": Case(
        FREE.format(""),
        plate=f"""<body><joint type="slide" axis="1 0 0"/>
        <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
            {PLATE}</body>""",
        speed=-1.0,
    ),
    "two targets": Case(FREE.format(""), speed=-1.0, targets=("target", "ball")),
    "a terrain from below": Case(
        '<geom type="hfield" hfield="hills" pos="0 0 -0.25"/>',
        """<asset><hfield name="hills" nrow="4" ncol="4" size="1 1 0.15 0.1"
            elevation="1 0 0 1 0 1 1 0 0 1 1 0 1 0 0 1"/></asset>""",
        plate_speed=-1.0,
    ),
}


def measure(case: Case) -> tuple[float, float]:
    """Momentum that the plate gained, and impulses on its surface [N s]."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" gravity="0 0 0" {case.option}<default>
        <geom condim="1"/></default>
        {case.more}<worldbody>{case.plate}{case.bodies}</worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    for joint in ("ball", "heavy"):
        if case.speed and f'joint name="{joint}"' in case.bodies:
            data.joint(joint).qvel[-1 if joint == "heavy" else 2] = case.speed
    data.joint("plate").qvel[0] = before = case.plate_speed
    materials = {name: Material(density=1e5) for name in case.targets}
    ripples = Ripples(model, materials, resolution=16, backend="cpu", conserve_volume=False)
    given = 0.0
    for _ in range(STEPS):
        case.script(data)
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(
            impulse.impulse for impulse in ripples.last_impulses if impulse.geom == "target"
        )
    return MASS * abs(data.joint("plate").qvel[0] - before), given


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=list(CASES), metavar="CASE")
    print("| how bodies push the plate | momentum of the plate [N s] | ", end="")
    print("impulse on its surface [N s] | error [%] |")
    print("| --- | --- | --- | --- |")
    for name in parser.parse_args().cases:
        gained, given = measure(CASES[name])
        error = 100 * abs(given / gained - 1)
        print(f"| {name} | {gained:.4f} | {given:.4f} | {error:.2f} |")


if __name__ == "__main__":
    main()
