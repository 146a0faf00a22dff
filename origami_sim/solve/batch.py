"""A batch of worlds on a device: the arrays behind the kernels, and the three things asked of them."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
import warp as wp

from origami_sim.drive import Drive
from origami_sim.effects import CONTACTS, get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, magnets, node_mass
from origami_sim.solve import grips, skin
from origami_sim.solve.kernels import grips as clamps
from origami_sim.solve.kernels import plates, sources
from origami_sim.solve.program.compose import BITS, compose
from origami_sim.solve.program.compose_sheets import asks_change
from origami_sim.threads import default_threads, in_turn

APART = 128
"""Bytes between the worlds' stretches of memory on the CPU: two cache lines, because processors fetch them in pairs.

With half of it a thread's last world and the next thread's first may share a pair; twice as much gains nothing.
"""


COMPILING = Lock()
"""Held while kernels are written and compiled, which threads must not do at once."""


@dataclass(frozen=True)
class Evaluation:
    """Forces and energies of one instant, by effect.

    Attributes:
        forces: effect name -> [N, W, 3] force on each node [N].
        energies: effect name -> [W] potential energy [J], for effects that have one.
        kinetic: [W] kinetic energy [J].
        angles: [C + Q, W] continuous hinge angles [rad].
        gaps: [K, W] height of each contact point above the ground [m].
    """

    forces: dict[str, np.ndarray]
    energies: dict[str, np.ndarray]
    kinetic: np.ndarray
    angles: np.ndarray
    gaps: np.ndarray


class Batch:
    """Model, parameters, drive and state of W worlds as device arrays.

    Args:
        model, parameters, drive, state: what to simulate; the state's worlds give W.
        device: warp device, "cpu" or "cuda:0".
        threads: on the CPU, how many threads share the worlds (default: all cores). Results do not depend on it.
        among: effects that the program has anyway, so that models with few of them share it; those that the model
            lacks do nothing.
        supports: the model with the supports that bend its sheets, where all nodes are held only to be led.

    Raises:
        InputError: parameters or drive for another number of worlds, too few electrode groups, no such device.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        *,
        device: str = "cpu",
        threads: int | None = None,
        among: Sequence[str] = (),
        supports: Model | None = None,
    ):
        try:
            self.device = wp.get_device(device)
        except (ValueError, RuntimeError):
            known = ", ".join(d.alias for d in wp.get_devices())
            raise InputError("there is no such device", field="device", value=device, allowed=known) from None
        every = [*(n for n in among if get(n).strengths or n in model.effects), *model.effects]
        self.model = model
        self.gripped = grips.moving(model, drive) and supports is None
        with COMPILING:
            self.program = compose(tuple(dict.fromkeys(every)), bool(among), self.gripped)
        self.worlds = state.worlds
        self.threads = 1 if self.device.is_cuda else max(1, min(threads or default_threads(), self.worlds))
        self._pool: ThreadPoolExecutor | None = None
        self._total: wp.Launch | None = None
        self._led: wp.Launch | None = None
        self._views: dict[int, np.ndarray] = {}
        self.step = state.step

        def constant(a, dtype):
            return wp.array(np.ascontiguousarray(a), dtype=dtype, device=self.device)

        groups = drive.groups
        if len(model.electrodes) and model.electrodes.max(initial=0) >= groups:
            raise InputError(
                "the drive has too few electrode groups",
                field="voltage",
                value=groups,
                allowed=f">= {int(model.electrodes.max()) + 1}",
            )
        laws = [get(n) for n in model.laws]
        uses_gradient = any("gradient" in e.drives for e in laws)
        gradients = [s for n, s in drive.signals.items() if n.startswith("gradient")]
        if not uses_gradient and not all(s.is_zero for s in gradients):
            raise InputError(
                "the drive has a field gradient that no effect of the model uses",
                field="gradient",
                allowed="switch on field_gradient",
            )
        if drive.placed and not uses_gradient:
            raise InputError(
                "the field differs from place to place, and no effect of the model feels its pull",
                field="sources",
                value=", ".join(kind for kind, _ in drive.placed),
                allowed="switch on field_gradient for remanent panels, or soft_magnet",
            )
        interacting = next((e.name for e in laws if e.interacts), None)
        none = np.full(len(model.triangles), -1, np.int32)
        self._mass = node_mass(model, parameters)
        self.magnets = none if interacting is None else magnets(model, parameters, interacting)
        hinges = np.concatenate([model.creases, model.bends]).reshape(-1, 4)
        buffer, layout = self._pack(parameters, drive)
        times, values = drive.samples()
        rows = np.cumsum([0, *(size for *_, size in model.memories)])
        first = {(e, m): row for (e, m, _), row in zip(model.memories, rows, strict=False)}
        kept = [(e.name, m.name) for e in self.program.effects for m in e.memory]
        self._places = [self.program.effects.index(e) for e in laws]
        self._buffer = constant(buffer, wp.float64)
        levels = self.program.slots.index(("drive", "offset"))
        self._levels = int(layout[levels, 0]), int(layout[levels + 1, 0] - layout[levels, 0])
        self._constants = [
            constant(model.free, wp.vec3d),
            constant(model.bars.reshape(-1, 2), wp.vec2i),
            constant(hinges, wp.vec4i),
            constant(model.electrodes, wp.int32),
            constant(model.triangles.reshape(-1, 3), wp.vec3i),
            constant(self.magnets, wp.int32),
            constant(model.contacts.reshape(-1, 3), wp.vec3i),
            constant(model.contact_weights.reshape(-1, 3), wp.vec3d),
            constant(model.contact_offsets, wp.float64),
            constant(model.contact_axes.reshape(-1, 3), wp.vec3d),
            len(model.creases),
            self._buffer,
            constant(layout, wp.int32),
            constant(times, wp.float64),
            constant(values, wp.float64),
            constant([first.get(k, 0) for k in kept] or [0], wp.int32),
            self._upload(self._acting(parameters) if among else np.zeros((1, self.worlds), np.int64), wp.int64),
        ]
        if self.program.sources_of_field:
            numbers = self._room(max(len(sources.NUMBERS) * len(drive.placed), 1), dtype=wp.float64)
            self._constants.append(sources.upload(drive, numbers, self.device))
        if self.program.shells:
            rows = 2 if any(map(asks_change, self.program.effects)) else 1
            room = [self._room(max(len(hinges), 1), dtype=wp.float64) for _ in range(rows)]
            self._constants.append(plates.upload(supports or model, self.device, *room))
        if self.program.touches:
            self._constants.append(skin.upload(model, self._room, self.device))
        row = len(self.program.effects)
        own = [clamps.upload(model, drive, grips.channels(model), row, self.device)] if self.gripped else []
        self._clamps: list[Any] = own
        self._x, self._v, self._a = (self._upload(s, wp.vec3d) for s in (state.x, state.v, state.a))
        self._f = self._room(max(len(model.position), 1), dtype=wp.vec3d)
        self._angles, self._memory = (self._upload(s, wp.float64) for s in (state.angles, state.memory))
        self._work, self._power = (self._upload(self._spread(s), wp.float64) for s in (state.work, state.power))
        self._status = self._upload(state.status, wp.int32)
        self._nothing = wp.zeros((0, 1, 1), dtype=wp.vec3d, device=self.device)
        self._no_angles = wp.zeros((0, 1, 1), dtype=wp.float64, device=self.device)
        self._no_notes = [wp.zeros(0, dtype=wp.int32, device=self.device), self._no_angles]

    def _acting(self, parameters: Parameters) -> np.ndarray:
        """[words, W] bits of the program's effects that have a strength anywhere in a world."""
        effects = self.program.effects
        out = np.zeros((len(effects) // BITS + 1, self.worlds), np.int64)
        for i in self._places:
            for p in effects[i].strengths:
                strong = np.any(parameters[effects[i].name, p.name] != 0.0, axis=0)
                out[i // BITS] |= strong.astype(np.int64) << (i % BITS)
        return out

    def _pack(self, parameters: Parameters, drive: Drive) -> tuple[np.ndarray, np.ndarray]:
        """All parameters in one buffer, and per slot its offset and its strides over entities and over worlds."""
        waves = drive.slots()
        absent = {e.name for e in self.program.effects} - set(self.model.effects)
        defaults, begins = self.program.defaults
        blocks, layout, offset = [defaults], [], len(defaults)
        for (owner, name), default in zip(self.program.slots, begins, strict=True):
            if owner in absent:  # one value for all of its entities
                layout.append((default, 0, 0))
                continue
            if owner == "drive":
                a = waves[name]
            else:
                a = self._mass if (owner, name) == ("inertia", "total") else parameters[owner, name]
            if (owner, name) == ("plane", "reach"):  # no contact law may be cut off
                reaches = [
                    parameters[e.name, "reach"].max()
                    for e in self.program.effects
                    if e.family in CONTACTS
                    and e.name not in absent
                    and "reach" in {p.name for p in e.parameters}
                    and parameters[e.name, "reach"].size
                ]
                a = np.maximum(a, max(reaches, default=0.0))
            worlds, knots = a.shape[1], math.prod(a.shape[2:])
            if worlds not in (1, self.worlds):
                raise InputError(
                    "a parameter is given for another number of worlds than the state has",
                    field=f"{owner}.{name}",
                    value=worlds,
                    allowed=f"1 or {self.worlds}",
                )
            blocks.append(self._arranged(a))
            entity, world = (worlds * knots, knots) if self.device.is_cuda else (knots, len(a) * knots)
            layout.append((offset, entity, world if worlds > 1 else 0))
            offset += a.size
        return np.concatenate(blocks), np.array(layout, np.int32)

    def _spread(self, a: np.ndarray) -> np.ndarray:
        """Rows [E, W] of the model's laws, and of its grips, in the places that these have in the program."""
        out = np.zeros((len(self.program.effects) + bool(len(self.model.grips)), a.shape[1]))
        out[self._rows] = a
        return out

    @property
    def _rows(self) -> list[int]:
        """Where the rows of work of a state are in the program's."""
        return [*self._places, len(self.program.effects)] if len(self.model.grips) else self._places

    def _arranged(self, a: np.ndarray) -> np.ndarray:
        """Numbers [E, W, ...] in the order in which they lie in the buffer: on the CPU world after world."""
        return np.ascontiguousarray(a if self.device.is_cuda else np.swapaxes(a, 0, 1), float).ravel()

    def _room(self, *shape: int, dtype, fill: Any = 0) -> wp.array:
        """An array [*shape, W]; with None for what fills it, as the memory happens to be.

        On a GPU the same entity of neighbouring worlds lies side by side, for threads that read together; on the CPU
        each world has a stretch of its own, for threads that must not write into each other's cache lines.
        """
        if self.device.is_cuda:
            # rows a multiple of 4 KiB apart would all fall into one cache set
            stride = self.worlds + (8 if self.worlds % 64 == 0 else 0)
            return _filled((*shape, stride), fill, dtype, self.device)
        size = wp.types.type_size_in_bytes(dtype)
        count = math.prod(shape)
        length = count + -(-APART // size)
        whole = _filled((self.worlds, length), fill, dtype, self.device)
        strides = (*(size * math.prod(shape[i + 1 :]) for i in range(len(shape))), size * length)
        shape = (*shape, self.worlds)
        out = wp.array(ptr=whole.ptr, dtype=dtype, shape=shape, strides=strides, device=self.device, copy=False)
        out._ref = whole  # keeps the memory
        return out

    def _upload(self, a: np.ndarray, dtype) -> wp.array:
        out = self._room(max(len(a), 1), dtype=dtype)
        if self.device.is_cpu:
            out.numpy()[: len(a)] = a
        else:
            padded = np.zeros((*out.shape, *a.shape[2:]), a.dtype)
            padded[: len(a), : self.worlds] = a
            out.assign(padded)
        return out

    def _view(self, a: wp.array) -> np.ndarray:
        """One of the batch's own arrays as numpy sees it; on the CPU it is the memory itself, and looked up once."""
        if not self.device.is_cpu:
            return a.numpy()
        if id(a) not in self._views:
            self._views[id(a)] = a.numpy()
        return self._views[id(a)]

    def _download(self, a: wp.array, rows: int) -> np.ndarray:
        return self._view(a)[:rows, : self.worlds].copy()

    def _launch(self, name: str, outputs: list):
        """Runs a kernel over all worlds, split over threads on the CPU (a launch releases the interpreter lock)."""
        inputs = [*self._constants, self._x, self._v, self._angles, self._memory]

        def run(lo: int, hi: int):
            wp.launch(
                kernel, dim=hi - lo, inputs=[*inputs, *(lo if o is _FIRST else o for o in outputs)], device=self.device
            )

        with COMPILING, in_turn():
            kernel = getattr(self.program, name)
            wp.load_module(kernel.module, device=self.device)
        if self.threads == 1:
            run(0, self.worlds)
        else:
            cuts = np.linspace(0, self.worlds, self.threads + 1).astype(int)
            if self._pool is None:
                self._pool = ThreadPoolExecutor(self.threads)
            list(self._pool.map(run, cuts[:-1], cuts[1:]))

    def advance(self, steps: int, dt: float, speed_limit: float):
        """Takes so many steps of dt [s]; a world faster than `speed_limit` [m/s] stops and keeps its status."""
        self._run(steps, dt, speed_limit, 0, self._nothing, self._no_angles, self._nothing)

    def lead(self, x: np.ndarray, dt: float):
        """Leads nodes that are held from where they are to positions [N, W, 3] within dt [s], where they then rest.

        Memory advances. (For rigid panels, make a batch of which all nodes are held.)
        """
        assert not self.model.free.any()
        self._overwrite(self._v, (x - self._download(self._x, len(x))) / dt)
        self._overwrite(self._a, np.zeros_like(x))
        self._overwrite(self._status, np.full((2, self.worlds), -1, np.int32))
        if self.threads > 1 or self.device.is_cuda:
            self.advance(1, dt, np.inf)
        else:  # asked many times over, and a recorded launch costs a tenth
            if self._led is None:
                rest = [self._a, self._f, self._work, self._power, self._status, 0, 0, 1, wp.float64(dt)]
                rest += [wp.float64(np.inf), 0, self._nothing, self._no_angles, self._nothing, *self._no_notes]
                inputs = [*self._constants, self._x, self._v, self._angles, self._memory, *rest]
                self._led = wp.launch(
                    self.program.rollout, dim=self.worlds, inputs=inputs, device=self.device, record_cmd=True
                )
            assert self._led is not None
            self._led.set_param_by_name("dt", wp.float64(dt))
            self._led.launch()
            self.step = max(self.step, 0) + 1
        self._overwrite(self._x, x)  # without the rounding of the way there
        self._overwrite(self._v, np.zeros_like(x))  # not what the step predicts for its end

    def film(self, frames: int, steps: int, dt: float, speed_limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Takes `steps` steps for each frame, and keeps every frame.

        Returns: positions [F, N, W, 3] [m] and hinge angles [F, C + Q, W] [rad]; nan after a world has stopped.
        """
        n, rows = len(self.model.position), len(self.model.creases) + len(self.model.bends)
        film = self._room(frames, max(n, 1), dtype=wp.vec3d, fill=None)
        angles = self._room(frames, max(rows, 1), dtype=wp.float64, fill=None)
        begun = max(self.step, 0)
        self._run(frames * steps, dt, speed_limit, steps, film, angles, self._nothing)
        x, turned = film.numpy()[:, :n, : self.worlds], angles.numpy()[:, :rows, : self.worlds]
        stopped = self.status()
        for w in np.flatnonzero(stopped >= 0):  # within the step before that number, or before all of these
            first = max(stopped[w] - 1 - begun, 0) // steps
            x[first:, :, w], turned[first:, :, w] = np.nan, np.nan
        return x, turned

    def carry(self, path: np.ndarray, dt: float, noted: Sequence[int] = ()) -> np.ndarray:
        """Carries the nodes that are held along positions path [F + 1, N, S, 3], one step of dt [s] each.

        World w follows column w modulo S. Returns what laws remember after each of so many steps, [R, M, W].
        """
        rates = wp.array(np.ascontiguousarray(np.diff(path, axis=0) / dt), dtype=wp.vec3d, device=self.device)
        rows = sum(size for *_, size in self.model.memories)
        when = wp.array(np.asarray(noted, np.int32), dtype=wp.int32, device=self.device)
        notes = self._room(len(noted), rows, dtype=wp.float64)
        self._run(len(path) - 1, dt, np.inf, 0, self._nothing, self._no_angles, rates, [when, notes])
        return notes.numpy()[:, :, : self.worlds]

    def _run(self, steps: int, dt: float, speed_limit: float, every: int, film, angles, carried, notes=()):
        self._launch(
            "rollout",
            [
                self._a,
                self._f,
                self._work,
                self._power,
                self._status,
                _FIRST,
                self.step,
                steps,
                wp.float64(dt),
                wp.float64(speed_limit),
                every,
                film,
                angles,
                carried,
                *(notes or self._no_notes),
                *self._clamps,
            ],
        )
        self.step = max(self.step, 0) + steps

    def total_force(self, time: float) -> np.ndarray:
        """Sum of all effects on every node, [N, W, 3] [N], at the state's positions and velocities."""
        if self.threads > 1:
            self._launch("total", [self._f, _FIRST, wp.float64(time)])
        else:  # asked many times over, and a recorded launch costs a tenth
            if self._total is None:
                inputs = [*self._constants, self._x, self._v, self._angles, self._memory, self._f, 0, wp.float64(time)]
                self._total = wp.launch(
                    self.program.total, dim=self.worlds, inputs=inputs, device=self.device, record_cmd=True
                )
            assert self._total is not None
            self._total.set_param_by_name("time", wp.float64(time))
            self._total.launch()
        return self._download(self._f, len(self.model.position))

    def evaluate(self, time: float) -> Evaluation:
        """Forces and energies by effect at time [s]."""
        m, effects = self.model, self.program.effects
        n, k = len(m.position), len(m.contacts)
        forces = self._room(len(effects), n, dtype=wp.vec3d)
        energies = self._room(len(effects), dtype=wp.float64)
        gaps = self._room(max(k, 1), dtype=wp.float64, fill=np.inf)
        self._launch("evaluate", [forces, energies, gaps, _FIRST, wp.float64(time)])
        f, v = forces.numpy()[:, :, : self.worlds], self._download(self._v, n)
        e = self._download(energies, len(effects))
        return Evaluation(
            forces={effects[i].name: f[i] for i in self._places},
            energies={effects[i].name: e[i] for i in self._places if effects[i].energy is not None},
            # summed node by node, because the order in which sum() adds depends on the number of worlds
            kinetic=0.5 * np.cumsum(self._mass * (v**2).sum(-1), axis=0)[-1],
            angles=self._download(self._angles, len(m.creases) + len(m.bends)),
            gaps=self._download(gaps, k),
        )

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions [N, W, 3] [m] and hinge angles [C + Q, W] [rad], without copying anything else."""
        m = self.model
        return self._download(self._x, len(m.position)), self._download(self._angles, len(m.creases) + len(m.bends))

    def remembered(self) -> np.ndarray:
        """[M, W] what laws remember."""
        return self._download(self._memory, sum(size for *_, size in self.model.memories))

    def status(self) -> np.ndarray:
        """[W] the step at which a world went unstable; -1: none."""
        return self._download(self._status, 2)[0]

    def place(self, x: np.ndarray, angles: np.ndarray, memory: np.ndarray | None = None):
        """Overwrites positions [N, W, 3], the angles from which they are continued [C + Q, W], and memory [M, W]."""
        self._overwrite(self._x, x)
        self._overwrite(self._angles, angles)
        if memory is not None:
            self._overwrite(self._memory, memory)

    def hold(self, levels: np.ndarray):
        """Another level of every channel of the drive, which has to be a held one.

        Args:
            levels: [channels, 1 or W], as many columns as the drive had that the batch was made with.
        """
        first, size = self._levels
        host = self._arranged(np.asarray(levels, float))
        assert len(host) == size
        if self.device.is_cpu:
            self._view(self._buffer)[first : first + len(host)] = host
        else:
            wp.copy(self._buffer, wp.array(host, dtype=wp.float64, device=self.device), first, 0, len(host))

    def _overwrite(self, target: wp.array, a: np.ndarray):
        if self.device.is_cpu:  # without an array in between
            self._view(target)[: len(a), : self.worlds] = a
        else:
            target.assign(self._upload(a, target.dtype))

    def state(self) -> State:
        """The present state, copied to the host."""
        m = self.model
        n = len(m.position)
        return State(
            x=self._download(self._x, n),
            v=self._download(self._v, n),
            a=self._download(self._a, n),
            angles=self._download(self._angles, len(m.creases) + len(m.bends)),
            memory=self.remembered(),
            work=self._download(self._work, len(self._work))[self._rows],
            power=self._download(self._power, len(self._power))[self._rows],
            step=self.step,
            status=self._download(self._status, 2),
        )


def _filled(shape: tuple[int, ...], fill: Any, dtype, device) -> wp.array:
    if fill is None:
        return wp.empty(shape, dtype=dtype, device=device)
    return wp.full(shape, fill, dtype=dtype, device=device)


_FIRST = object()
"""Placeholder for the first world of a launch."""


def forces(model: Model, parameters: Parameters, drive: Drive, state: State, time: float, **options) -> Evaluation:
    """Forces and energies of a state, one named array per effect."""
    return Batch(model, parameters, drive, state, **options).evaluate(time)
