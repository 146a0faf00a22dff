"""Writes the part of the kernels that bends and stretches sheets as shells (see `compose`)."""

from contextlib import contextmanager
from typing import Any

from origami_sim.effects import SHELLS, Effect


def asks_change(effect: Effect) -> bool:
    """Whether a law of sheets asks by how much strains or curvatures change in a step."""
    return effect.family in SHELLS and "change" in effect.arguments


class Text:
    """Lines of source at a current depth."""

    def __init__(self, depth: int):
        self.depth, self.lines = depth, []

    def __call__(self, line: str = "", shift: int = 0):
        self.lines.append("    " * (self.depth + shift) + line if line else "")

    @contextmanager
    def block(self, head: str):
        """Lines that belong to a head such as an `if`."""
        self(head)
        self.depth += 1
        yield
        self.depth -= 1

    def __str__(self):
        return "\n".join(self.lines)


class Sheets:
    """Strains and curvatures of triangles, for the laws of membranes and plates; a part of the composer."""

    effects: Any
    family: Any
    number: Any
    acting: Any
    apply_law: Any
    add_energy: Any
    add_work: Any
    scatter: Any
    _fold: Any

    def _sheets(self, t: Text, mode: str):
        """Membrane forces and moments, whose shares of the hinges are collected before they become forces."""
        effects = self.family(*SHELLS)
        if not effects:
            return
        hinges = "for row in range(crease_count, hinges.shape[0]):"

        def at_hinge():
            t("r = row & NATURAL")
            for i, node in enumerate("ijkl"):
                t(f"{node} = hinges[r][{i}] & NATURAL")
            self._fold(t)

        if not self.family("bend"):  # whose laws have brought the angles up to date
            with t.block(hinges):
                at_hinge()
                if mode == "rollout":
                    self._note_turn(t)
                t("angles[r, w] = angle")
        apart = mode == "evaluate" or any(e.exchanges_work for e in effects)
        for group in [[e] for e in effects] if apart else [effects]:
            with t.block(hinges):
                t("plates.moment[row, w] = scalar(0.0)")
            for e in group:
                with self.acting(t, e):
                    (self._membrane if e.family == "membrane" else self._plate)(t, e, mode)
            with t.block(hinges):
                at_hinge()
                t("moment = plates.moment[r, w]")
                for node in "ijkl":
                    self.scatter(t, group[0], node, f"moment * g.g{node}", mode)
                if apart:
                    rate = " + ".join(f"wp.dot(g.g{n}, V[{n}, w])" for n in "ijkl")
                    self.add_work(t, group[0], f"moment * ({rate})", mode)

    def _note_turn(self, t: Text):
        """Keeps by how much a hinge has turned in this step, before its angle is brought up to date."""
        if any(map(asks_change, self.effects)):
            t("plates.turn[r, w] = angle - angles[r, w]")

    def _membrane(self, t: Text, e: Effect, mode: str):
        i, moving = self.number(e), mode == "rollout" and asks_change(e)
        with t.block("for row in range(triangles.shape[0]):"):
            t("c = row & NATURAL")
            for k in (1, 2, 3):
                t(f"n{k} = triangles[c][{k - 1}] & NATURAL")
            t("shape = plates.shape[c]")
            self._strain(t, moving)
            t("arcs = shells.arcs(plates, angles, c, w)")
            t("bow = shells.bow(plates, c, arcs)")
            if moving:
                t("change = strain - earlier + bow")
                t("change = change - shells.bow(plates, c, arcs - shells.arcs(plates, plates.turn, c, w))")
            elif asks_change(e):
                t("change = vec3()")
            t("strain = strain + bow")
            self.apply_law(t, e, "c", mode, f"N{i}")
            self.add_energy(t, e, "c", mode, "plates.area[c]")
            t(f"shells.unbow(plates, c, w, arcs, plates.area[c] * N{i})")
            t(f"R{i} = shells.pull(y1, y2, y3, shape, plates.area[c] * N{i})")
            corners = [f"kinematics.corner(R{i}, {k})" for k in range(3)]
            for k, corner in enumerate(corners):
                self.scatter(t, e, f"n{k + 1}", corner, mode)
            self.add_work(t, e, " + ".join(f"wp.dot({f}, V[n{k + 1}, w])" for k, f in enumerate(corners)), mode)

    def _strain(self, t: Text, moving: bool):
        """A triangle's strain, and the corners at which its gradient is taken; its strain where the step began."""
        for i in (1, 2, 3):
            t(f"y{i} = X[n{i}, w]")
        t("strain = shells.strain(y1, y2, y3, shape)")
        if moving:  # the step was made with the velocity at its middle, half a kick behind the prediction
            for i in (1, 2, 3):
                t(f"y{i}_before = y{i} - h * (V[n{i}, w] - half * A[n{i}, w])")
            t("earlier = shells.strain(y1_before, y2_before, y3_before, shape)")

    def _plate(self, t: Text, e: Effect, mode: str):
        i = self.number(e)
        with t.block("for row in range(plates.triangle.shape[0]):"):
            t("c = plates.triangle[row] & NATURAL")
            t("whole = plates.whole[row]")
            t("curvature = shells.bent(plates, angles, row, w)")
            if asks_change(e):
                t(f"change = {'shells.curved(plates, plates.turn, row, w)' if mode == 'rollout' else 'vec3()'}")
            self.apply_law(t, e, "c", mode, f"M{i}")
            self.add_energy(t, e, "c", mode, "plates.share[row]")
            t(f"shells.spread(plates, row, w, plates.share[row] * M{i})")
