"""Writes the kernels of a set of effects: the fused rollout, and the same laws reported effect by effect.

A rollout runs the whole time loop of one world in one thread. Its body is the list of laws that are switched on, each
called with the arguments that it names, so that an effect costs nothing when it is off and nobody maintains a kernel
by hand. The source is composed as text (see `Program.sources`), compiled once per set of effects and cached by warp.
"""

import functools
import hashlib
import linecache
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
import warp as wp

from origami_sim.effects import CONTACTS, DISTORTIONS, HINGES, PAIRS, SHELLS, Effect, get
from origami_sim.physics import kinematics, magnetostatics
from origami_sim.solve.kernels import articulated, grips, plates, runge_kutta, sources, touching
from origami_sim.solve.kernels.wave import wave
from origami_sim.solve.program import templates
from origami_sim.solve.program.compose_rigid import Rigid, is_steady
from origami_sim.solve.program.compose_sheets import Sheets, Text
from origami_sim.solve.program.compose_touch import Touching, pair_value

FIELD, GRADIENT, TEMPERATURE, LOAD, ORIGIN, VOLTAGE = 0, 3, 12, 13, 14, 15
"""First drive channel of each quantity; voltages of further electrode groups follow."""

FIXED_SLOTS = (
    *(("inertia", name) for name in ("mass", "total")),
    *(("plane", name) for name in ("tilt", "azimuth", "height", "reach")),
    *(("drive", name) for name in ("offset", "amplitude", "angular_frequency", "phase", "scale")),
)
"""Parameters that every model has besides those of its effects."""

MOVING = ("rollout", "rigid")
"""Kernels with a time loop: of nodes, and of rigid panels."""

BITS = 62
"""Effects of which one integer tells whether they act in a world."""

CPU_FLAGS = "-fno-slp-vectorize -ffp-contract=fast"
"""Two numbers of a vector stored by halves and loaded whole wait for the store; without packing they do not.

Products and sums are fused across statements, as on CUDA. The other kernels round every one, so that a law without
strength adds exactly nothing.
"""


@dataclass(frozen=True)
class Program:
    """The kernels of an ordered set of effects, each compiled when it is first asked for.

    Attributes:
        effects: the effects, in the order of their summation.
        slots: (owner, parameter) of every parameter slot of the buffer.
        sources: the kernels as text, by name.
    """

    effects: tuple[Effect, ...]
    slots: tuple[tuple[str, str], ...]
    sources: dict[str, str]

    @functools.cached_property
    def defaults(self) -> tuple[np.ndarray, list[int]]:
        """The default of every parameter slot, one after the other, and where each begins."""
        own = {(e.name, p.name): np.full(p.knots, p.default) for e in self.effects for p in e.parameters}
        each = [own.get(slot, np.zeros(1)) for slot in self.slots]
        return np.concatenate(each), [0, *np.cumsum([len(a) for a in each])[:-1].tolist()]

    @property
    def shells(self) -> bool:
        """Whether the kernels take the rows of curvature."""
        return any(e.family in SHELLS for e in self.effects)

    @property
    def touches(self) -> bool:
        """Whether the kernels take the surface."""
        return any(e.family in PAIRS for e in self.effects)

    @property
    def sources_of_field(self) -> bool:
        """Whether the kernels take the sources of a field that differs from place to place."""
        return any("gradient" in e.drives for e in self.effects)

    @functools.cached_property
    def rollout(self) -> wp.Kernel:
        return self._kernel("rollout")

    @functools.cached_property
    def rigid(self) -> wp.Kernel:
        return self._kernel("rigid")

    @functools.cached_property
    def evaluate(self) -> wp.Kernel:
        return self._kernel("evaluate")

    @functools.cached_property
    def total(self) -> wp.Kernel:
        return self._kernel("total")

    def _kernel(self, name: str) -> wp.Kernel:
        kernel = written(self.sources[name], name, self.effects)
        if name in MOVING and hasattr(wp.config, "cpu_compiler_flags"):  # warp 1.15 has no such setting
            common = wp.config.cpu_compiler_flags or "-march=native"
            kernel.module.options["cpu_compiler_flags"] = f"{common} {CPU_FLAGS}"
        return kernel


def written(source: str, name: str, effects: tuple[Effect, ...]) -> wp.Kernel:
    """The kernel of that name, in a module of its own, so that nothing is compiled that is not run."""
    module = f"origami_sim.composed_{hashlib.sha256(source.encode()).hexdigest()[:12]}"
    filename = f"<{module}>"
    # warp reads the source of a kernel through inspect, which looks here first
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    scope = {
        "__name__": module,
        "wp": wp,
        "scalar": wp.float64,
        "vec3": wp.vec3d,
        "kinematics": kinematics,
        "magnetostatics": magnetostatics,
        "wave": wave,
        "articulated": articulated,
        "runge_kutta": runge_kutta,
        "shells": plates,
        "touching": touching,
        "fields": sources,
        "clamps": grips,
        "NATURAL": articulated.NATURAL,
    }
    for e in effects:
        scope[f"{e.name}_force"] = e.force
        if e.energy is not None:
            scope[f"{e.name}_energy"] = e.energy
        if e.magnet is not None:
            scope[f"{e.name}_magnet"] = e.magnet
    exec(compile(source, filename, "exec"), scope)
    return scope[name]


class _Composer(Rigid, Sheets, Touching):
    def __init__(self, effects: tuple[Effect, ...], shared: bool = False, gripped: bool = False):
        self.effects, self.shared, self.gripped = effects, shared, gripped
        self.slots = FIXED_SLOTS + tuple((e.name, p.name) for e in effects for p in e.parameters)
        self.index = {s: i for i, s in enumerate(self.slots)}
        self.drives = {d for e in effects for d in e.drives}

    def family(self, *names: str) -> list[Effect]:
        return [e for e in self.effects if e.family in names]

    def number(self, effect: Effect) -> int:
        return self.effects.index(effect)

    def value(self, owner: str, name: str, entity: str) -> str:
        i = self.index[owner, name]
        return f"articulated.at(P, o{i} + {entity} * e{i})"

    def hoist(self) -> str:
        """Parameter addresses of this world, read once."""
        t = Text(1)
        for i, (owner, _) in enumerate(self.slots):
            if owner != "drive":
                t(f"o{i} = layout[{i}, 0] + w * layout[{i}, 2]")
                t(f"e{i} = layout[{i}, 1]")
        for i, (owner, name) in enumerate((e.name, m.name) for e in self.effects for m in e.memory):
            t(f"m_{owner}_{name} = memory_rows[{i}]")
        if self.family(*CONTACTS):
            tilt, azimuth = self.value("plane", "tilt", "0"), self.value("plane", "azimuth", "0")
            t(f"up = kinematics.plane_normal({tilt}, {azimuth})")
            t(f"plane_height = {self.value('plane', 'height', '0')}")
            t(f"reach = {self.value('plane', 'reach', '0')}")
        for word in range(-(-len(self.effects) // BITS) if self.shared else 0):
            t(f"on{word} = active[{word}, w]")
        if self.family("pair"):
            t("pressed = int(-1)  # a node that is pressed too deep into the surface")
            t("swept = scalar(0.0)  # how far a pair came within a step, over what it may")
        return str(t)

    def channel(self, k: str) -> str:
        first = self.index["drive", "offset"]
        return f"wave(P, layout, {first}, {k}, w, series_times, series_values, time)"

    def call(self, effect: Effect, which: str, entity: str, **renamed: str) -> str:
        arguments = effect.asked(which)
        own = {p.name: p for p in effect.parameters}
        memory = {m.name for m in effect.memory}
        given = []
        for name in arguments:
            if name in own:
                slot = self.index[effect.name, name]
                table = own[name].knots > 1
                if effect.family in PAIRS:
                    given.append(pair_value(*(self.value(effect.name, name, side) for side in ("ta", "tb"))))
                else:
                    given.append(f"o{slot} + {entity} * e{slot}" if table else self.value(effect.name, name, entity))
            elif name in memory:
                given.append(f"{effect.name}_{name}")
            elif name == "buffer":
                given.append("P")
            elif name == "dt":
                given.append("h")
            elif name == "time":
                given.append("age")
            else:
                given.append(renamed.get(name, name))
        return f"{effect.name}_{which}({', '.join(given)})"

    def acting(self, t: Text, effect: Effect):
        """Begins a block that worlds in which an effect has no strength pass over, so that it costs next to nothing."""
        acts = self.acts(effect)
        return nullcontext() if acts == "True" else t.block(f"if {acts}:")

    def acts(self, effect: Effect) -> str:
        """Whether an effect has any strength in a world."""
        word, bit = divmod(self.number(effect), BITS)
        told = self.shared and effect.strengths
        return f"(on{word} & wp.int64({1 << bit})) != wp.int64(0)" if told else "True"

    def alike(self, effects: list[Effect]) -> list[list[Effect]]:
        """Effects that share a loop; each has its own where a world is to pass over at once what does not act in it."""
        return [[e] for e in effects] if self.shared or not effects else [effects]

    def apply_law(self, t: Text, effect: Effect, entity: str, mode: str, result: str):
        """Calls a force law with its memory read before and, in a rollout, written after."""
        outputs = [result]
        writes = []
        for m in effect.memory:
            row = f"m_{effect.name}_{m.name} + {m.size} * {entity}"
            local = f"{effect.name}_{m.name}"
            if m.size == 1:
                t(f"{local} = memory[{row}, w]")
                writes.append(f"memory[{row}, w] = {local}_new")
            else:
                t(f"{local} = vec3(memory[{row}, w], memory[{row} + 1, w], memory[{row} + 2, w])")
                writes += [f"memory[{row} + {i}, w] = {local}_new[{i}]" for i in range(3)]
            outputs.append(f"{local}_new")
        t(f"{', '.join(outputs)} = {self.call(effect, 'force', entity)}")
        if mode == "rollout":
            for line in writes:
                t(line)
        if mode == "rigid" and writes:  # stages in between look ahead and change nothing
            with t.block("if last:"):
                for line in writes:
                    t(line)

    def add_energy(self, t: Text, effect: Effect, entity: str, mode: str, times: str = ""):
        if mode == "evaluate" and effect.energy is not None:
            i = self.number(effect)
            law = self.call(effect, "energy", entity)
            t(f"energies[{i}, w] = energies[{i}, w] + {f'{times} * {law}' if times else law}")

    def add_work(self, t: Text, effect: Effect, power: str, mode: str):
        if mode in MOVING and effect.exchanges_work:
            t(f"power_{effect.name} += {power}")

    def scatter(self, t: Text, effect: Effect, node: str, force: str, mode: str):
        """Adds to the node: to the effect's own array when reporting, to the sum otherwise."""
        target = f"forces[{self.number(effect)}, {node}, w]" if mode == "evaluate" else f"F[{node}, w]"
        t(f"{target} = {target} + {force}")

    def body(self, mode: str) -> str:
        """The force evaluation. Modes: 'rollout', 'rigid', 'total' (summed) and 'evaluate' (by effect)."""
        t = Text({"rollout": 2, "rigid": 4}.get(mode, 1))
        if {"field", "gradient"} & self.drives:
            t(f"uniform_field = vec3({', '.join(self.channel(str(FIELD + i)) for i in range(3))})")
        if "gradient" in self.drives:
            t(f"uniform_gradient = wp.mat33d({', '.join(self.channel(str(GRADIENT + i)) for i in range(9))})")
            with t.block("for n in range(sources.kind.shape[0] * fields.SIZE):"):
                t(f"sources.now[n, w] = {self.channel('sources.first + n')}")
        if "temperature" in self.drives:
            t(f"temperature = {self.channel(str(TEMPERATURE))}")
        if "load" in self.drives:
            t(f"load = {self.channel(str(LOAD))}")
        if "time" in self.drives:
            t(f"age = time + {self.channel(str(ORIGIN))}")
        for e in self.effects:
            if mode in MOVING and e.exchanges_work:
                t(f"power_{e.name} = scalar(0.0)")
        self._nodes(t, mode)
        self._bars(t, mode)
        for family in HINGES:
            self._hinges(t, mode, family)
        if mode != "rigid":  # panels that neither bend nor stretch
            self._sheets(t, mode)
        self._triangles(t, mode)
        self._contacts(t, mode)
        self._pairs(t, mode)
        for i, e in enumerate(self.effects):
            if mode == "rollout" and e.exchanges_work:
                with self.acting(t, e):
                    t(f"work[{i}, w] = work[{i}, w] + half * (power[{i}, w] + power_{e.name})")
                    t(f"power[{i}, w] = power_{e.name}")
            if mode == "rigid" and e.exchanges_work:
                with self.acting(t, e):
                    spent = f"tree.data[(w * tree.width + tree.spent + {i}) & NATURAL]"
                    t(f"{spent} = {spent} + weighs * power_{e.name}")
                    with t.block("if last:"):
                        t(f"power[{i}, w] = power_{e.name}")
        return str(t)

    def _nodes(self, t: Text, mode: str):
        effects = [e for e in self.family("node") if mode != "rigid" or not is_steady(e)]
        for group in self.alike(effects):
            rows, n = ("tree.moving", "tree.moving[row & NATURAL]") if mode == "rigid" else ("mask", "row")
            with self.acting(t, group[0]), t.block(f"for row in range({rows}.shape[0]):"):
                t(f"n = {n} & NATURAL")
                t(f"mass = {self.value('inertia', 'mass', 'n')}")
                t("x = X[n, w]")
                t("v = V[n, w]")
                for e in group:
                    i = self.number(e)
                    self.apply_law(t, e, "n", mode, f"F{i}")
                    self.add_energy(t, e, "n", mode)
                    self.scatter(t, e, "n", f"F{i}", mode)
                    self.add_work(t, e, f"wp.dot(F{i}, v)", mode)

    def _bars(self, t: Text, mode: str):
        effects = self.family("bar")
        if not effects:
            return
        t("for row in range(bars.shape[0]):")
        t.depth += 1
        t("b = row & NATURAL")
        t("p = bars[b][0] & NATURAL")
        t("q = bars[b][1] & NATURAL")
        self._span(t)
        if any("rate" in e.arguments or e.exchanges_work for e in effects):
            t("rate = wp.dot(along, V[q, w] - V[p, w])")
        if any("voltage" in e.drives for e in effects):  # bars belong to the first electrode group
            t(f"voltage = {self.channel(f'{VOLTAGE}')}")
        if mode != "evaluate":
            t("tension = scalar(0.0)")
        for e in effects:
            i = self.number(e)
            with self.acting(t, e):
                self.apply_law(t, e, "b", mode, f"T{i}")
                self.add_energy(t, e, "b", mode)
                self.add_work(t, e, f"-T{i} * rate", mode)
                if mode == "evaluate":
                    self.scatter(t, e, "p", f"T{i} * along", mode)
                    self.scatter(t, e, "q", f"-T{i} * along", mode)
                else:
                    t(f"tension += T{i}")
        if mode != "evaluate":
            t("pull = tension * along")
            t("F[p, w] = F[p, w] + pull")
            t("F[q, w] = F[q, w] - pull")
        t.depth -= 1

    def _span(self, t: Text):
        """A bar's length and its gradient at the bar's second node."""
        t("span = X[q, w] - X[p, w]")
        t("length = wp.length(span)")
        t("along = span * (scalar(1.0) / length)")

    def _hinges(self, t: Text, mode: str, family: str):
        effects = self.family(family)
        if not effects and family != "crease":  # fold angles are followed also where no law asks for them
            return
        # rows of hinges: creases first, then bending lines; parameters count within their family
        count, shift = "crease_count", "0"
        if family == "bend":
            count, shift = "hinges.shape[0] - crease_count", "crease_count"
        t(f"for c in range({count}):")
        t.depth += 1
        t(f"r = (c + {shift}) & NATURAL")
        for i, node in enumerate("ijkl"):
            t(f"{node} = hinges[r][{i}] & NATURAL")
        if mode == "rigid":
            t("fold = articulated.fold(tree, hinges, angles, X, V, r, w)")
            t("angle = fold[0]")
        else:
            self._fold(t)
        if any("turn" in e.arguments for e in effects):
            t("turn = angle - angles[r, w]" if mode in MOVING else "turn = scalar(0.0)")
        if family == "bend" and mode == "rollout":
            self._note_turn(t)
        if mode == "rigid":
            with t.block("if last:"):
                t("angles[r, w] = angle")
            t("rate = fold[1]")
        else:
            t("angles[r, w] = angle")
        if mode != "rigid" and any("rate" in e.arguments or e.exchanges_work for e in effects):
            t("rate = " + " + ".join(f"wp.dot(g.g{n}, V[{n}, w])" for n in "ijkl"))
        if any("voltage" in e.drives for e in effects):
            t(f"voltage = {self.channel(f'{VOLTAGE} + electrodes[r]')}")
        if any("field" in e.drives for e in effects):  # in the middle of the axis
            self._field(t, "scalar(0.5) * (X[j, w] + X[k, w])")
        if mode != "evaluate":
            t("moment = scalar(0.0)")
        for e in effects:
            i = self.number(e)
            with self.acting(t, e):
                self.apply_law(t, e, "c", mode, f"M{i}")
                self.add_energy(t, e, "c", mode)
                self.add_work(t, e, f"M{i} * rate", mode)
                if mode == "evaluate":
                    for node in "ijkl":
                        self.scatter(t, e, node, f"M{i} * g.g{node}", mode)
                else:
                    t(f"moment += M{i}")
        if not effects:
            t.depth -= 1
            return
        if mode == "rigid":
            t("articulated.bend(tree, hinges, X, F, r, w, moment)")
        elif mode != "evaluate":
            for node in "ijkl":
                t(f"F[{node}, w] = F[{node}, w] + moment * g.g{node}")
        t.depth -= 1

    def _field(self, t: Text, place: str):
        """The field at a place and its gradient, if any law asks for that."""
        if "gradient" not in self.drives:
            t("field = uniform_field")
            return
        t(f"place = {place}")
        t("placed = fields.near(sources, place, w)")
        t("field = uniform_field + uniform_gradient * place + placed.field")
        t("gradient = uniform_gradient + placed.gradient")

    def _fold(self, t: Text):
        """A hinge's angle, continued from its last one, and its gradients."""
        t("g = kinematics.dihedral(X[i, w], X[j, w], X[k, w], X[l, w])")
        t("angle = kinematics.unwrap(g.angle, angles[r, w])")

    def _triangles(self, t: Text, mode: str):
        effects = self.family("triangle")
        if not effects:
            return
        for group in self.alike(effects):
            with self.acting(t, group[0]), t.block("for row in range(triangles.shape[0]):"):
                t("c = row & NATURAL")
                self.pass_over(t, group, mode)
                for i in (1, 2, 3):
                    t(f"n{i} = triangles[c][{i - 1}] & NATURAL")
                    t(f"x{i} = X[n{i}, w]")
                    t(f"v{i} = V[n{i}, w]")
                if any({"field", "gradient"} & set(e.drives) for e in group):
                    self._field(t, "(x1 + x2 + x3) / scalar(3.0)")
                for e in group:
                    i = self.number(e)
                    if e.interacts:
                        self._stray(t, e)
                    self.apply_law(t, e, "c", mode, f"R{i}")
                    self.add_energy(t, e, "c", mode)
                    for k in (1, 2, 3):
                        self.scatter(t, e, f"n{k}", f"kinematics.corner(R{i}, {k - 1})", mode)
                    if e.exchanges_work:
                        corners = [f"wp.dot(kinematics.corner(R{i}, {k - 1}), v{k})" for k in (1, 2, 3)]
                        self.add_work(t, e, " + ".join(corners), mode)

    def _stray(self, t: Text, effect: Effect):
        """Field of all magnets but its own, at a triangle's magnet."""
        t("stray = vec3(scalar(0.0), scalar(0.0), scalar(0.0))")
        t("stray_gradient = wp.mat33d()")
        t(f"own, at = {self.call(effect, 'magnet', 'c')}")
        t("for other in range(triangles.shape[0]):")
        t.depth += 1
        t("u = other & NATURAL")
        t("if magnets[c] >= 0 and magnets[u] >= 0 and magnets[u] != magnets[c]:")
        t.depth += 1
        for i in (1, 2, 3):
            t(f"y{i} = X[triangles[u][{i - 1}] & NATURAL, w]")
        t(f"source, there = {self.call(effect, 'magnet', 'u', x1='y1', x2='y2', x3='y3')}")
        strength = (self.value(effect.name, effect.fitted[0], entity) for entity in "cu")
        t(f"source = scalar(0.5) * ({' + '.join(strength)}) * source")
        t("stray = stray + magnetostatics.dipole_field(at - there, source)")
        t("stray_gradient = stray_gradient + magnetostatics.dipole_gradient(at - there, source)")
        t.depth -= 2

    def _contacts(self, t: Text, mode: str):
        effects = self.family(*CONTACTS)
        if not effects:
            return
        t("for row in range(contacts.shape[0]):")
        t.depth += 1
        t("c = row & NATURAL")
        for i in (1, 2, 3):
            t(f"n{i} = contacts[c][{i - 1}] & NATURAL")
        t("share = weights[c]")
        t("off = offsets[c]")
        t("at = share[0] * X[n1, w] + share[1] * X[n2, w] + share[2] * X[n3, w]")
        t("patch = kinematics.normal_gradients(X[n1, w], X[n2, w], X[n3, w])")
        t("at = at + off * patch.n")
        t("gap = wp.dot(up, at) - plane_height")
        if mode == "rigid":
            t("way = at - articulated.vec_at(tree.data, w * tree.width + tree.feet0 + 3 * c)")
            with t.block("if last:"):
                t("articulated.put_vec(tree.data, w * tree.width + tree.feet + 3 * c, at)")
        if mode == "evaluate":
            t("gaps[c, w] = gap")
        t("if gap < reach:")
        t.depth += 1
        # velocity of the contact point: d(normal) = -sum (n . dx_i) grad_i
        t("velocity = share[0] * V[n1, w] + share[1] * V[n2, w] + share[2] * V[n3, w]")
        t(
            "velocity = velocity - off * ("
            + " + ".join(f"wp.dot(patch.n, V[n{i}, w]) * patch.g{i}" for i in (1, 2, 3))
            + ")"
        )
        t("rate = wp.dot(up, velocity)")
        t("normal_load = scalar(0.0)")
        t("push = vec3(scalar(0.0), scalar(0.0), scalar(0.0))")
        for e in self.family("contact"):
            i = self.number(e)
            with self.acting(t, e):
                self.apply_law(t, e, "c", mode, f"N{i}")
                self.add_energy(t, e, "c", mode)
                t(f"normal_load += wp.max(N{i}, scalar(0.0))")
                self.add_work(t, e, f"N{i} * rate", mode)
                self._contact_force(t, e, f"N{i} * up", mode)
        tangents = self.family("tangent")
        if tangents:
            # the coefficient may depend on the direction in which the foot slides or is about to slide
            t("normal = up")
            t("velocity = velocity - up * rate")
            t("speed = wp.length(velocity)")
            t("slip = way - up * wp.dot(up, way)" if mode == "rigid" else "slip = velocity * h")
            if mode == "rollout":
                # the step was made with the velocity at its middle, half a kick behind the prediction
                t("kick = share[0] * A[n1, w] + share[1] * A[n2, w] + share[2] * A[n3, w]")
                kicks = " + ".join(f"wp.dot(patch.n, A[n{i}, w]) * patch.g{i}" for i in (1, 2, 3))
                t(f"kick = kick - off * ({kicks})")
                t("slip = slip - (kick - up * wp.dot(up, kick)) * (half * h)")
            if self.family("coefficient"):
                ahead = " + ".join(f"axes[c][{i - 1}] * X[n{i}, w]" for i in (1, 2, 3))
                t(f"ahead = {ahead}")
                t("axis = kinematics.unit_or_zero(ahead - up * wp.dot(up, ahead))")
                row = f"m_{tangents[0].name}_{tangents[0].memory[0].name} + 3 * c"
                t(f"strain = vec3(memory[{row}, w], memory[{row} + 1, w], memory[{row} + 2, w])")
                t("direction = kinematics.unit_or_zero(strain + slip)")
            t("coefficient = scalar(0.0)")
            for e in self.family("coefficient"):
                i = self.number(e)
                with self.acting(t, e):
                    self.apply_law(t, e, "c", mode, f"C{i}")
                    t(f"coefficient += C{i}")
            for e in tangents:
                i = self.number(e)
                self.apply_law(t, e, "c", mode, f"S{i}")
                self.add_work(t, e, f"wp.dot(S{i}, velocity)", mode)
                self._contact_force(t, e, f"S{i}", mode)
        if mode != "evaluate":
            for i in (1, 2, 3):
                t(f"F[n{i}, w] = F[n{i}, w] + share[{i - 1}] * push - (off * wp.dot(push, patch.g{i})) * patch.n")
        t.depth -= 1
        resets = [m for e in tangents for m in e.memory]
        if resets and mode in MOVING:
            with t.block("elif last:" if mode == "rigid" else "else:"):
                for e in tangents:
                    for m in e.memory:
                        for k in range(m.size):
                            t(f"memory[m_{e.name}_{m.name} + {m.size} * c + {k}, w] = scalar(0.0)")
        t.depth -= 1

    def _contact_force(self, t: Text, effect: Effect, force: str, mode: str):
        if mode != "evaluate":
            t(f"push = push + {force}")
            return
        t(f"part = {force}")
        for i in (1, 2, 3):
            at_node = f"share[{i - 1}] * part - (off * wp.dot(part, patch.g{i})) * patch.n"
            self.scatter(t, effect, f"n{i}", at_node, mode)

    def arguments(self) -> str:
        """What every kernel takes."""
        return templates.arguments(bool(self.family(*SHELLS)), "gradient" in self.drives, bool(self.family(*PAIRS)))

    def sources(self) -> dict[str, str]:
        given = {"arguments": self.arguments(), "hoist": self.hoist()}
        mass, rigid = self.value("inertia", "total", "n"), {"steady": self.steady(), **self.asked()}
        texts = (templates.HALT, templates.HALT_RIGID, templates.SWEPT_RIGID)
        total = self.index["inertia", "total"]
        moved = templates.GRIPS if self.gripped else templates.STANDING
        moved = {**moved, "put": moved["put"].format(mass=f"o{total}, e{total}")}
        halt, stop, swept = ("\n" + s if self.family("pair") else "" for s in texts)
        return {
            "rollout": templates.ROLLOUT.format(**given, **moved, body=self.body("rollout"), mass=mass, halt=halt),
            "rigid": templates.RIGID.format(**given, **rigid, **moved, body=self.body("rigid"), halt=stop, swept=swept),
            "evaluate": templates.EVALUATE.format(**given, body=self.body("evaluate")),
            "total": templates.TOTAL.format(**given, body=self.body("total")),
        }


@functools.cache
def compose(names: tuple[str, ...], shared: bool = False, gripped: bool = False) -> Program:
    """The program of these effects. Raises InputError for an unknown effect.

    Args:
        shared: by models of which some lack effects; laws are then passed over in worlds where they have no strength.
        gripped: whether kernels that go on in time take grips that move.
    """
    effects = tuple(e for e in map(get, names) if e.family not in DISTORTIONS)
    composer = _Composer(effects, shared, gripped)
    return Program(effects, composer.slots, composer.sources())
