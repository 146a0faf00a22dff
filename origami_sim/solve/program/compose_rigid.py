"""Writes what is particular to the kernel of rigid panels: forces that never change, and nodes that no law asks for."""

from typing import Any

from origami_sim.effects import Effect
from origami_sim.solve.program.compose_sheets import Text


def is_steady(effect: Effect) -> bool:
    """Whether a law gives every node a force that never changes, as weight does: rigid bodies feel their sums."""
    own = {p.name for p in effect.parameters if p.knots == 1}
    return effect.family == "node" and not effect.exchanges_work and {*effect.arguments} <= {"mass", *own}


def asks_corners(effect: Effect) -> bool:
    """Whether a law of rigid panels asks for places of their corners, or acts on them."""
    hinges = effect.family == "crease" and not {"field", "gradient"} & {*effect.drives}
    return not (hinges or effect.family == "node")


def asks_nodes(effect: Effect) -> bool:
    """Whether a law of rigid panels asks for places of all nodes, also of those that are but masses."""
    return effect.family in ("node", "bar") and not is_steady(effect)


class Rigid:
    """Steady forces by body, and which nodes laws ask for; a part of the composer."""

    effects: Any
    value: Any
    call: Any
    acting: Any
    acts: Any

    def steady(self) -> str:
        """Sums up, once per launch, the forces on each body that never change."""
        t = Text(1)
        laws = [e for e in self.effects if is_steady(e)]
        t("articulated.unload(tree, w)")
        if laws:
            with t.block("for row in range(tree.moving.shape[0]):"):
                t("n = tree.moving[row & NATURAL] & NATURAL")
                t(f"mass = {self.value('inertia', 'mass', 'n')}")
                for e in laws:
                    with self.acting(t, e):
                        t(f"articulated.load(tree, n, {self.call(e, 'force', 'n')}, w)")
        return str(t)

    def asked(self) -> dict[str, str]:
        """Whether a world has laws that need its corners, or all nodes."""
        # corners tell the angle that closes a loop
        return {
            "cornered": self._any(["tree.rows > 0", *(self.acts(e) for e in self.effects if asks_corners(e))]),
            "nodal": self._any([self.acts(e) for e in self.effects if asks_nodes(e)]),
        }

    def pass_over(self, t: Text, group: list[Effect], mode: str):
        """Passes over an entity at which laws that remember nothing have no strength: often one of all is suspected."""
        if mode == "rigid" and all(e.strengths and not e.memory for e in group):
            each = [f"{self.value(e.name, p.name, 'c')} == scalar(0.0)" for e in group for p in e.strengths]
            with t.block(f"if {' and '.join(each)}:"):
                t("continue")

    @staticmethod
    def _any(conditions: list[str]) -> str:
        return "True" if "True" in conditions else " or ".join(conditions) or "False"
