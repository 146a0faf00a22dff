"""Writes what is particular to the kernel of rigid panels: forces that never change, and worlds that need no nodes."""

from typing import Any

from origami_sim.effects import Effect
from origami_sim.solve.compose_sheets import Text


def is_steady(effect: Effect) -> bool:
    """Whether a law gives every node a force that never changes, as weight does: rigid bodies feel their sums."""
    own = {p.name for p in effect.parameters if p.knots == 1}
    return effect.family == "node" and not effect.exchanges_work and {*effect.arguments} <= {"mass", *own}


def asks_nodes(effect: Effect) -> bool:
    """Whether a law of rigid panels asks for places of nodes, or acts on them."""
    hinges = effect.family == "crease" and not {"field", "gradient"} & {*effect.drives}
    return not (hinges or is_steady(effect))


class Rigid:
    """Steady forces by body, and which worlds have laws of nodes; a part of the composer."""

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

    def nodal(self) -> str:
        """Whether a world has laws that need its nodes: of a closed loop they tell the angle that closes it."""
        each = [self.acts(e) for e in self.effects if asks_nodes(e)]
        return "True" if "True" in each else " or ".join(["tree.rows > 0", *each])
