"""Compiles crawler_loop.c and runs it on the same numbers."""

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")


def _struct(integers: str, doubles: str, vectors: str = "", *, vectors_first: bool = False) -> np.dtype:
    parts = [(n, "i4") for n in integers.split()]
    numbers, vecs = [(n, "f8") for n in doubles.split()], [(n, "f8", 3) for n in vectors.split()]
    return np.dtype(parts + (vecs + numbers if vectors_first else numbers + vecs), align=True)


NODE = _struct("", "mass gx gy gz", "x v a f free", vectors_first=True)
BAR = _struct("p q", "stiffness rest")
HINGE = _struct("i j k l", "angle stiffness rest viscosity")
TRIANGLE = _struct("n1 n2 n3", "remanence volume a b c")
CONTACT = _struct("n1 n2 n3", "w1 w2 w3 off a1 a2 a3 kn cn mu back kt ct", "bristle")


class _World(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_int) for n in ("nodes", "bars", "creases", "hinges", "triangles", "contacts")),
        *((n, ctypes.c_void_p) for n in ("node", "bar", "hinge", "triangle", "contact")),
        ("field", ctypes.c_double * 12), ("plane", ctypes.c_double * 4), ("exchange", ctypes.c_double * 8),
        ("failed", ctypes.c_int * 2),
    ]  # fmt: skip


def compiler() -> str | None:
    """Path of the C compiler, or None."""
    return shutil.which(os.environ.get("CC", "cc"))


def library() -> ctypes.CDLL:
    """Compiles the loop into a temporary folder and loads it."""
    cc, source = compiler(), Path(__file__).with_name("crawler_loop.c")
    if cc is None:
        raise FileNotFoundError("there is no C compiler")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "crawler_loop.so"
        subprocess.run([cc, *FLAGS, str(source), "-o", str(out), "-lm"], check=True)
        return ctypes.CDLL(str(out))


class CLoop:
    """One world of the strip (see crawler_strip.py), as arrays of structs."""

    def __init__(self, lib, model, parameters, drive, *, world: int = 0):
        self._lib, self._steps_done = lib, -1

        def value(owner, name):
            a = parameters[owner, name]
            return a[:, world if a.shape[1] > 1 else 0]

        def fill(dtype, n, **columns):
            a = np.zeros(n, dtype)
            for name, column in columns.items():
                a[name] = column
            return a

        self.node = fill(NODE, len(model.position), x=model.position, free=model.free, mass=value("inertia", "mass"),
                         **{f"g{c}": value("gravity", f"gravity_{c}") for c in "xyz"})  # fmt: skip
        b, h, t, k = model.bars, np.concatenate([model.creases, model.bends]), model.triangles, model.contacts
        self.bar = fill(
            BAR, len(b), p=b[:, 0], q=b[:, 1], stiffness=value("bars", "stiffness"), rest=value("bars", "rest_length")
        )
        loss = np.concatenate([value("crease_viscosity", "viscosity"), np.zeros(len(model.bends))])
        self.hinge = fill(
            HINGE, len(h), i=h[:, 0], j=h[:, 1], k=h[:, 2], l=h[:, 3], viscosity=loss,
            stiffness=np.concatenate([value("crease", "stiffness"), value("panel_bending", "stiffness")]),
            rest=np.concatenate([value("crease", "rest_angle"), value("panel_bending", "rest_angle")]),
        )  # fmt: skip
        magnet = {"remanence": "remanence", "volume": "volume", "a": "poling_1", "b": "poling_2", "c": "poling_n"}
        m = {c: value("magnetic_torque", n) for c, n in magnet.items()}
        self.triangle = fill(TRIANGLE, len(t), n1=t[:, 0], n2=t[:, 1], n3=t[:, 2], **m)
        self.contact = fill(
            CONTACT, len(k), off=model.contact_offsets,
            **{f"n{i + 1}": k[:, i] for i in range(3)}, **{f"w{i + 1}": model.contact_weights[:, i] for i in range(3)},
            **{f"a{i + 1}": model.contact_axes[:, i] for i in range(3)},
            kn=value("ground", "stiffness"), cn=value("ground", "damping"), mu=value("coulomb", "friction_coefficient"),
            back=value("directional_friction", "backward_excess"),
            kt=value("friction", "stiffness"), ct=value("friction", "damping"),
        )  # fmt: skip
        waves = drive.slots()
        numbers = ("offset", "amplitude", "angular_frequency", "phase")
        field = [float(waves[n][c].flat[0]) for c in range(3) for n in numbers]
        plane = [float(value("plane", n)[0]) for n in ("tilt", "azimuth", "height", "reach")]
        self._world = _World(
            len(self.node), len(b), len(model.creases), len(h), len(t), len(k),
            *(a.ctypes.data for a in (self.node, self.bar, self.hinge, self.triangle, self.contact)),
            (ctypes.c_double * 12)(*field), (ctypes.c_double * 4)(*plane), (ctypes.c_double * 8)(),
            (ctypes.c_int * 2)(-1, -1),
        )  # fmt: skip

    def advance(self, steps: int, dt: float, speed_limit: float):
        numbers = (ctypes.c_double(dt), ctypes.c_double(speed_limit))
        self._lib.run(ctypes.byref(self._world), self._steps_done, steps, *numbers)
        self._steps_done = max(self._steps_done, 0) + steps

    @property
    def x(self) -> np.ndarray:
        return self.node["x"]

    @property
    def work(self) -> np.ndarray:
        """Work of crease viscosity, magnets, ground and friction [J]."""
        return np.array(self._world.exchange[:4])
