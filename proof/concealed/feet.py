"""Feet on the ground: a Hertzian push with Hunt and Crossley's loss, and Dahl's friction with a sharp limit.

MuJoCo's own contacts would not do. With stiff ones all four points of the crawler's feet touch in a third of the steps
only, and the walk is 7.0 mm instead of 7.4 mm, whatever step, stiffness, damping, cone and solver options are chosen;
softer ones creep. We think it is the associated cone, by which what slides also rises (as in Anitescu 2006).
"""

import math

import numpy as np

LOSS = 1.0
"""Hunt and Crossley's factor on the speed of compression [s/m]."""

SHARP = 6
"""Exponent of Dahl's law: at 1 a foot creeps long before it slides."""


class Foot:
    """A pair of points below a panel, in the plane of the motion.

    Attributes:
        name, panel: which. friction: coefficient, now. height, speed: of the tip [m], along x [m/s]. lever: from the
            panel's centre of mass to the tip [m].
    """

    def __init__(self, told: dict, arm: np.ndarray, friction: float):
        """
        Args:
            told: of the object. arm: from the centre of mass to the tip, in the panel's axes [m].
        """
        self.name, self.panel, self.arm, self.friction = told["name"], told["panel"], arm.tolist(), friction
        self._hertz = told["load"] / told["give"] ** 1.5
        self._shear = told["friction"] * told["load"] / told["give"]
        self.rest()

    def rest(self) -> None:
        """Forgets."""
        self.pull = self.height = self.speed = 0.0
        self.lever = (0.0, 0.0, 0.0)

    def press(self, world, dt: float) -> None:
        """Adds the force of the ground to the panel's wrench."""
        turn, (sx, sy, sz), (vx, _, vz), height = world.moving(self.panel)
        ax, ay, az = self.arm
        x, y, z = (turn[i] * ax + turn[i + 1] * ay + turn[i + 2] * az for i in (0, 3, 6))
        self.lever, self.height = (x, y, z), height + z
        self.speed, rise = vx + sy * z - sz * y, vz + sx * y - sy * x
        push = 0.0
        if self.height < 0.0:
            push = max(0.0, self._hertz * (-self.height) ** 1.5 * (1.0 - LOSS * rise))
        limit = self.friction * push
        pull = max(-limit, min(limit, self.pull))
        if limit > 0.0:
            along = math.copysign(abs(pull / limit) ** SHARP, pull * self.speed)
            pull += self._shear * self.speed * dt * (1.0 - along)
        self.pull = max(-limit, min(limit, pull))
        self.pressed(world, -self.pull, push)

    def pressed(self, world, along: float, up: float) -> None:
        """Adds a force at the tip, along x and z [N], to the panel's wrench."""
        wrench = world.wrench[self.panel]
        wrench[0] += along
        wrench[2] += up
        wrench[4] += self.lever[2] * along - self.lever[0] * up
