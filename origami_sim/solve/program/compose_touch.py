"""Writes the part of the kernels in which panels touch each other (see `compose` and `touching`)."""

from contextlib import nullcontext
from typing import Any

from origami_sim.solve.program.compose_sheets import Text

DEEPEST = 0.5
"""Share of the distance at which a pair touches by which it may be pressed together; a world that exceeds it stops.

Beyond all of it the two would be through each other, which the distance does not tell.
"""

FOUR = range(4)


class Touching:
    """Near pairs of the surface, for the laws of what touches; a part of the composer."""

    effects: Any
    index: Any
    family: Any
    number: Any
    acting: Any
    call: Any
    add_energy: Any
    add_work: Any
    value: Any

    def _pairs(self, t: Text, mode: str):
        normals, rubs = self.family("pair"), self.family("rub")
        if not normals:
            return
        moving = mode in ("rollout", "rigid")
        with self.acting(t, normals[0]):
            slot = self.index[normals[0].name, "thickness"]
            if mode == "rigid":  # what a stage in between comes to says nothing of the step
                t("pressed = int(-1)")
            t(f"travel = touching.travelled(skin, X, P, o{slot}, e{slot}, w)")
            for e in rubs:
                t(f"room_{e.name} = 32 + 4 * triangles.shape[0]")
                t(f"top_{e.name} = m_{e.name}_{e.memory[0].name}")
                t(f"held_{e.name} = touching.remembered(memory, top_{e.name}, room_{e.name}, w)")
                t(f"cursor_{e.name} = int(0)")
                t(f"kept_{e.name} = int(0)")
            with t.block("if travel > skin.span[0, w]:"), t.block("for row in range(skin.count[0, w]):"):
                with t.block("if travel > skin.wake[row, w]:"):
                    t("gap = touching.distance(skin, X, row, w) - skin.offset[row, w]")
                    with t.block("if gap < scalar(0.0):"):
                        t("near = touching.look(skin, X, row, w)")
                        self._pair(t, normals, rubs, mode)
            if mode == "rigid":
                self._swept(t)
            if moving:
                with t.block("if skin.count[1, w] > 1:"):
                    t("pressed = 0")
            for e in rubs:
                self._turn_over(t, e, mode)

    def _swept(self, t: Text):
        """How far the nearest pairs came within a step that an error alone would let carry them past each other.

        What is not in the list stays clear of everything within half its margin.
        """
        with t.block("if last:"):
            t("trip = h * touching.fastest(skin, X, V, w)")
            t("swept = trip / skin.span[1, w]")
            with t.block("for row in range(skin.count[0, w]):"), t.block("if travel + trip > skin.wake[row, w]:"):
                t("swept = wp.max(swept, touching.swept(skin, X, V, row, h, w))")

    def _pair(self, t: Text, normals, rubs, mode: str):
        for k in FOUR:
            t(f"p{k} = skin.points[row, w][{k}]")
        t("ta = skin.kind[row, w][1] & NATURAL")
        t("tb = skin.kind[row, w][2] & NATURAL")
        for k in FOUR:
            t(f"v{k} = touching.velocity(skin, X, V, p{k}, w)")
        t("closing = " + " + ".join(f"near.share[{k}] * v{k}" for k in FOUR))
        t("rate = wp.dot(near.normal, closing)")
        t("normal_load = scalar(0.0)")
        for e in normals:
            i = self.number(e)
            t(f"N{i} = {self.call(e, 'force', '')}")
            stored = ""
            if e.energy is not None:
                t(f"U{i} = {self.call(e, 'energy', '')}")
                stored = f" - U{i} * near.w"
                if mode == "evaluate":
                    t(f"energies[{i}, w] = energies[{i}, w] + near.window * U{i}")
            for k in FOUR:
                t(f"q{k} = (near.window * N{i} * near.share[{k}]) * near.normal{stored and stored + str(k)}")
            self._push(t, e, mode)
            t(f"normal_load += near.window * wp.max(N{i}, scalar(0.0))")
        for e in rubs:
            with self.acting(t, e):
                self._rub(t, e, mode)
        if mode in ("rollout", "rigid"):
            with t.block(f"if gap < scalar({-DEEPEST}) * skin.offset[row, w] and normal_load > scalar(0.0):"):
                t("pressed = touching.node(skin, p0)")

    def _rub(self, t: Text, e, mode: str):
        i, name, memory = self.number(e), e.name, f"{e.name}_{e.memory[0].name}"
        t("normal = near.normal")

        def tangential(out: str, of: str):
            t(f"{out} = " + " + ".join(f"near.j{k} * {of}{k}" for k in FOUR))
            t(f"{out} = {out} - normal * wp.dot(normal, {out})")

        tangential("velocity", "v")
        t("slip = velocity * h")
        if mode == "rollout":
            # the step was made with the velocity at its middle, half a kick behind the prediction
            for k in FOUR:
                t(f"a{k} = touching.velocity(skin, X, A, p{k}, w)")
            tangential("kick", "a")
            t("slip = slip - kick * (half * h)")
        list_of = f"top_{name} + 2 + 3 * room_{name} * "
        t("label = skin.label[row, w]")
        t(f"entry = touching.recall(memory, top_{name}, room_{name}, held_{name}, cursor_{name}, label, w)")
        t(f"{memory} = vec3(scalar(0.0), scalar(0.0), scalar(0.0))")
        with t.block("if entry >= 0:"):
            t(f"at_entry = {list_of}touching.present(memory, top_{name}, w) + 3 * entry")
            t(f"{memory} = memory[at_entry + 1, w] * near.t1 + memory[at_entry + 2, w] * near.t2")
            t(f"cursor_{name} = entry + 1")
        t(f"S{i}, {memory}_new = {self.call(e, 'force', '')}")
        for k in FOUR:
            t(f"q{k} = wp.transpose(near.j{k}) * S{i}")
        self._push(t, e, mode)
        if mode in ("rollout", "rigid"):
            with t.block("if last:") if mode == "rigid" else nullcontext():  # stages in between change nothing
                with t.block(f"if kept_{name} < room_{name}:"):
                    t(f"at_entry = {list_of}(1 - touching.present(memory, top_{name}, w)) + 3 * kept_{name}")
                    t("memory[at_entry, w] = label")
                    t(f"memory[at_entry + 1, w] = wp.dot({memory}_new, near.t1)")
                    t(f"memory[at_entry + 2, w] = wp.dot({memory}_new, near.t2)")
                    t(f"kept_{name} += 1")
                with t.block("else:"):
                    t("skin.count[1, w] = 2")

    def _push(self, t: Text, e, mode: str):
        target = f"forces[{self.number(e)}]" if mode == "evaluate" else "F"
        for k in FOUR:
            t(f"touching.push(skin, X, {target}, p{k}, q{k}, w)")
        self.add_work(t, e, " + ".join(f"wp.dot(q{k}, v{k})" for k in FOUR), mode)

    def _turn_over(self, t: Text, e, mode: str):
        """Makes the list of what touched in this step the present one."""
        if mode not in ("rollout", "rigid"):
            return
        top = f"top_{e.name}"
        with t.block("if last:") if mode == "rigid" else nullcontext():
            t(f"memory[{top} + 1, w] = scalar(kept_{e.name})")
            t(f"memory[{top}, w] = scalar(1 - touching.present(memory, {top}, w))")


def pair_value(one: str, other: str) -> str:
    """A parameter of a pair: the mean of its sides'."""
    return f"(scalar(0.5) * ({one} + {other}))"
