"""Physics of the robots: a point mass for each in plain Python, or bodies in MuJoCo."""

from __future__ import annotations

import math
from typing import Protocol

from floor import GRAVITY, PLACES, AISLE_HALF_WIDTH, ROLLING_RESISTANCE, WET, Day

ROBOT_MASS = 60.0
ROBOT_RADIUS = 0.3
MOTOR_FORCE = 60.0
STEP = 0.01
"""Step of the physics, in seconds."""

GRIP_FORCE = 330.0
LIFT_ACCELERATION = 1.5

Vector = tuple[float, float]


class Engine(Protocol):
    """Bodies on the floor of a depot."""

    name: str

    def position(self, robot: str) -> Vector: ...
    def velocity(self, robot: str) -> Vector: ...
    def set_payload(self, robot: str, mass: float) -> None: ...

    def advance(self, forces: dict[str, Vector], steps: int, people: list[Vector]) -> None:
        """Applies forces for some steps. ``people`` are where they are now."""

    def holds(self, mass: float, friction: float) -> bool:
        """Returns ``True`` if the gripper lifts a crate, ``False`` if the crate slips out of it."""


class PlainEngine:
    """Point masses with rolling resistance; bodies that touch push each other away."""

    name = "plain"

    def __init__(self, day: Day, robots: dict[str, Vector]) -> None:
        self._position = {robot: list(at) for robot, at in robots.items()}
        self._velocity = {robot: [0.0, 0.0] for robot in robots}
        self._mass = {robot: ROBOT_MASS for robot in robots}

    def position(self, robot: str) -> Vector:
        x, y = self._position[robot]
        return x, y

    def velocity(self, robot: str) -> Vector:
        x, y = self._velocity[robot]
        return x, y

    def set_payload(self, robot: str, mass: float) -> None:
        self._mass[robot] = ROBOT_MASS + mass

    def advance(self, forces: dict[str, Vector], steps: int, people: list[Vector]) -> None:
        for _ in range(steps):
            for robot, force in forces.items():
                self._step(robot, force, people)

    def _step(self, robot: str, force: Vector, people: list[Vector]) -> None:
        mass, at, velocity = self._mass[robot], self._position[robot], self._velocity[robot]
        others = [self.position(it) for it in self._position if it != robot]
        push = _push(self.position(robot), others + people)
        for axis in (0, 1):
            wall = _wall(self.position(robot)) if axis == 0 else 0.0
            velocity[axis] += (force[axis] + push[axis] + wall) / mass * STEP
        speed = math.hypot(*velocity)
        slowed = max(0.0, speed - ROLLING_RESISTANCE * GRAVITY * STEP)
        for axis in (0, 1):
            velocity[axis] *= slowed / speed if speed > 0 else 0.0
            at[axis] += velocity[axis] * STEP

    def holds(self, mass: float, friction: float) -> bool:
        return 2 * friction * GRIP_FORCE >= mass * (GRAVITY + LIFT_ACCELERATION)


def _push(at: Vector, others: list[Vector]) -> Vector:
    """Force of a contact: a stiff spring between bodies that overlap."""
    x = y = 0.0
    for other in others:
        away = (at[0] - other[0], at[1] - other[1])
        apart = math.hypot(*away)
        overlap = 2 * ROBOT_RADIUS - apart
        if overlap > 0 and apart > 0:
            x += 4000 * overlap * away[0] / apart
            y += 4000 * overlap * away[1] / apart
    return x, y


def _wall(at: Vector) -> float:
    """Force of the shelves next to the aisle."""
    aside = at[0] - PLACES["rack"][0]
    overlap = abs(aside) + ROBOT_RADIUS - (AISLE_HALF_WIDTH + 0.3)
    return -math.copysign(4000 * overlap, aside) if WET[0] < at[1] < WET[1] and 0 < overlap < 0.6 else 0.0


def _depot_model(robots: dict[str, Vector], people: int) -> str:
    """The depot as a model of MuJoCo: robots stand on the floor with the friction of rolling wheels."""
    x, length = PLACES["rack"][0], WET[1] - WET[0]
    parts = [
        f'<geom name="wall{side}" type="box" size="0.1 {length / 2} 0.5" '
        f'pos="{x + side * (AISLE_HALF_WIDTH + 0.4)} {WET[0] + length / 2} 0.5"/>'
        for side in (-1, 1)
    ]
    for robot, (at_x, at_y) in robots.items():
        joints = "".join(
            f'<joint name="{robot}_{axis}" type="slide" axis="{" ".join("1" if it == axis else "0" for it in "xyz")}"/>'
            for axis in "xyz"
        )
        parts.append(
            f'<body name="{robot}" pos="{at_x} {at_y} 0.2">{joints}<geom name="{robot}" type="cylinder" '
            f'size="{ROBOT_RADIUS} 0.2" mass="{ROBOT_MASS}" friction="{ROLLING_RESISTANCE} 0 0" priority="1"/></body>'
        )
    parts += [
        f'<body name="person{number}" mocap="true" pos="0 0 0.8"><geom type="capsule" size="0.25 0.5"/></body>'
        for number in range(people)
    ]
    return (
        f'<mujoco><option timestep="{STEP}" integrator="implicitfast" cone="elliptic"/><worldbody>'
        f'<geom type="plane" size="40 40 1"/>{"".join(parts)}</worldbody></mujoco>'
    )


_GRIP_STEP = 0.002
_FINGER = '<geom type="box" size="0.02 0.1 0.1" mass="1"/>'
_GRIPPER = f"""<mujoco><option timestep="{_GRIP_STEP}" integrator="implicitfast" cone="elliptic" impratio="10"/>
<worldbody><geom type="box" size="1 1 0.05" pos="0 0 0.3"/>
<body name="hand" pos="0 0 0.5"><joint name="lift" type="slide" axis="0 0 1"/>
<geom type="box" size="0.02 0.02 0.02" pos="0 0 0.4" mass="5" contype="0" conaffinity="0"/>
<body pos="-0.25 0 0"><joint name="left" type="slide" axis="1 0 0"/>{_FINGER}</body>
<body pos="0.25 0 0"><joint name="right" type="slide" axis="1 0 0"/>{_FINGER}</body></body>
<body name="crate" pos="0 0 0.5"><freejoint/>
<geom name="crate" type="box" size="0.22 0.15 0.15" mass="20" priority="1"/></body></worldbody>
<actuator><motor joint="left" gear="{GRIP_FORCE}"/><motor joint="right" gear="-{GRIP_FORCE}"/>
<velocity joint="lift" kv="100000"/></actuator></mujoco>"""


class MujocoEngine:
    """Bodies of MuJoCo: contacts of robots with the floor, each other, people and walls."""

    name = "mujoco"

    def __init__(self, day: Day, robots: dict[str, Vector]) -> None:
        import mujoco

        self._mujoco = mujoco
        self._start = robots
        self._model = mujoco.MjModel.from_xml_string(_depot_model(robots, len(day.people)))
        self._data = mujoco.MjData(self._model)
        self._dofs = {robot: self._model.joint(f"{robot}_x").dofadr[0] for robot in robots}
        mujoco.mj_forward(self._model, self._data)

    def position(self, robot: str) -> Vector:
        x, y = self._start[robot]
        first = self._dofs[robot]
        return x + float(self._data.qpos[first]), y + float(self._data.qpos[first + 1])

    def velocity(self, robot: str) -> Vector:
        first = self._dofs[robot]
        return float(self._data.qvel[first]), float(self._data.qvel[first + 1])

    def set_payload(self, robot: str, mass: float) -> None:
        self._model.body(robot).mass[0] = ROBOT_MASS + mass

    def advance(self, forces: dict[str, Vector], steps: int, people: list[Vector]) -> None:
        for number, (x, y) in enumerate(people):
            self._data.mocap_pos[number] = (x, y, 0.8)
        for robot, force in forces.items():
            first = self._dofs[robot]
            self._data.qfrc_applied[first : first + 2] = force
        self._mujoco.mj_step(self._model, self._data, nstep=steps)

    def holds(self, mass: float, friction: float) -> bool:
        """Two fingers close on the crate and lift it by 0.3 m."""
        model = self._mujoco.MjModel.from_xml_string(_GRIPPER)
        model.geom("crate").friction[:] = (friction, 0.005, 0.0001)
        crate = model.body("crate")
        crate.inertia[:] *= mass / crate.mass[0]
        crate.mass[0] = mass
        data = self._mujoco.MjData(model)
        for step in range(450):
            rising = min(max(step - 100, 0), 150) * _GRIP_STEP * LIFT_ACCELERATION
            data.ctrl[:] = (1.0, 1.0, rising)
            self._mujoco.mj_step(model, data)
        slipped = data.body("hand").xpos[2] - data.body("crate").xpos[2]
        return bool(slipped < 0.1)


def mujoco_version() -> str | None:
    """The version of MuJoCo, or ``None`` if it is not installed."""
    try:
        import mujoco
    except ImportError:
        return None
    return str(mujoco.__version__)
