"""Panels of which nobody stated whether they touch: seen from frame to frame, and then kept apart."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim import Drive, Sheet, continuation, equilibrium, quasistatic, ramp, simulate, strip
from origami_sim import sheet as mesh
from origami_sim.errors import InputError
from origami_sim.explore import Way, angle, find
from origami_sim.explore.gradients import gradient
from origami_sim.locate.meeting import meetings
from origami_sim.model import State
from origami_sim.predict.memories import Motion
from origami_sim.predict.rollouts import Rollouts
from origami_sim.solve.watch import Met, watch_of

MM = 1e-3


def roll(rest=100.0, panels="rigid"):
    """Four panels that turn by so many degrees each: with 100 the last one through the first."""
    s = Sheet(strip([10 * MM] * 4, 20 * MM), thickness=0.5 * MM, panels=panels, triangulation="diagonal")
    s.fix(panels=[0])
    return s.crease(stiffness=0.2e-3, rest_angle=math.radians(rest), loss_time=20e-3)


def closing(target):
    """Two panels that are turned towards each other by so many radians."""
    s = Sheet(strip([10 * MM] * 2, 20 * MM), thickness=0.5 * MM, panels="rigid").fix(panels=[0])
    return s.crease(stiffness=0.2e-3).set("crease_drive", drive_stiffness=0.4e-3, target_angle=target / 2)


def simulated(sheet, rate=60, **options):
    return simulate(*sheet.build(), duration=0.3, rate=rate, **options)


@pytest.mark.parametrize(("rate", "which"), [(20, "meet at t = 0.0"), (60, "panel 0 and panel 3 meet at t = 0.06")])
def test_a_run_in_which_panels_meet_is_that_with_stated_contact(rate, which):
    """Between frames that are far apart the way is not known well, and others may seem to meet before."""
    run, stated, through = (simulated(s, rate) for s in (roll(), roll().touch(), roll().touch(False)))
    assert np.array_equal(run.x, stated.x)
    assert run.model.laws == stated.model.laws and run.crossings() == [0]
    assert which in run.notes[0] and "touch(False)" in run.notes[0]
    assert through.crossings()[0] > 0 and "touch" not in through.model.laws


def test_a_run_in_which_none_meet_is_that_without_contact():
    run, bare = (simulated(s) for s in (roll(60.0), roll(60.0).touch(False)))
    assert np.array_equal(run.x, bare.x)
    assert run.model.laws == bare.model.laws and run.notes == bare.notes


def test_what_passes_between_two_frames_is_seen():
    """A small plate flies through a large one in a twentieth of the time between two frames."""
    large, small = [(-30, -30), (30, -30), (30, 30), (-30, 30)], [(-3, -3), (3, -3), (3, 3), (-3, 3)]
    corners = np.array([(x, y, z) for z, c in ((0, large), (20, small)) for x, y in c]) * MM
    s = Sheet(mesh(corners, [(0, 1, 2, 3), (4, 5, 6, 7)]), thickness=0.1 * MM).fix(panels=[0])
    model, parameters = s.build()
    start = State.at_rest(model)
    start.v[4:8, 0, 2] = -2.0
    watch, said = watch_of(model, parameters, start, reference=True)
    assert watch is not None and not said
    end = start.x + 0.02 * start.v
    assert (end[4:8, 0, 2] < -15 * MM).all()
    watch.add(0.0, start.x, start.v)
    watch.add(0.02, end, start.v)
    with pytest.raises(Met, match=r"panel 0 and panel 1 meet at t = 0\.0099"):  # 0.1 mm before 10 ms
        watch.look()


def test_one_world_that_touches_has_all_run_with_contact():
    model, parameters = roll().build()
    rest = parameters["crease", "rest_angle"] * np.array([[0.6, 1.0]])
    run = simulate(model, parameters.copy().set("crease", "rest_angle", rest), duration=0.3, rate=60)
    assert "meet" in run.notes[0] and run.notes[0].split(":")[0].endswith("in world 1")
    assert np.array_equal(run.x[:, :, 1], simulated(roll()).x[:, :, 0])
    assert np.abs(run.x[-1, :, 0] - simulated(roll(60.0)).x[-1, :, 0]).max() < 1e-9


def test_bars_that_are_pressed_too_deep_are_run_again_with_stiffer_contact():
    run = simulated(roll(panels="elastic"))
    assert not run.failures and run.crossings() == [0]
    assert "4 times the default" in run.notes[0]
    stated = simulated(roll(panels="elastic").touch())
    assert run.parameters["touch", "stiffness"] == pytest.approx(4 * stated.parameters["touch", "stiffness"])
    assert "pressed" in stated.failures[0].cause


def test_a_run_that_is_continued_keeps_its_contact():
    model, parameters = roll().build()
    whole = simulate(model, parameters, duration=0.3, rate=60)
    for first in (0.05, 0.15):  # before panels meet, and after
        half = simulate(model, parameters, duration=first, rate=60)
        assert ("touch" in half.model.laws) == (first > 0.1)
        rest = simulate(model, parameters, duration=0.3 - first, rate=60, state=half.state)
        assert np.abs(rest.x[-1] - whole.x[-1]).max() < 1e-6
        assert rest.times[-1] == pytest.approx(0.3)
    other, own = roll().touch(False).on("gravity").build()
    with pytest.raises(InputError, match="the state is of another model"):
        state = State.at_rest(model)
        state.memory = np.zeros((3, 1))
        simulate(model, parameters, duration=0.1, state=state)
    assert "touch" not in other.laws and not own["surface", "thickness"].any()


def test_equilibria_and_slow_motions_keep_panels_apart():
    """Two panels whose crease would turn by more than half a turn."""
    model, parameters = closing(3.3).build()
    found = equilibrium(model, parameters, Drive(load=1.0))
    assert found.converged and found.angles[0] < math.pi and "half a turn" in found.touching
    assert len(found.state.memory) == len(State.at_rest(model).memory)
    assert equilibrium(model, parameters, Drive(load=1.0), contact=False).angles[0] == pytest.approx(3.3)
    apart = equilibrium(*roll(60.0).build())
    assert apart.touching == "" and np.degrees(apart.angles) == pytest.approx(60.0)

    def slow(sheet):
        return quasistatic(*sheet.build(), Drive(load=ramp(1.0, 1.0)), np.linspace(0, 1, 11))

    run, through = slow(closing(3.3)), slow(closing(3.3).touch(False))
    assert not run.failures and run.creases.max() < math.pi < through.creases.max()
    assert any("panel 0 and panel 1 meet at t = 0.9" in n for n in run.notes)


def test_what_lies_in_each_other_at_the_start_stays_so_and_is_told():
    corners = np.array([(x, y, z) for z in (0, 0.3) for x, y in ((0, 0), (9, 0), (9, 9), (0, 9))]) * MM
    s = Sheet(mesh(corners, [(0, 1, 2, 3), (4, 5, 6, 7)]), thickness=0.5 * MM).fix(panels=[0]).gravity()
    run = simulate(*s.build(), duration=0.01)
    assert "panel 0 and panel 1 lie in each other at the start" in run.notes[0]
    assert "touch" not in run.model.laws


def test_what_passes_through_has_no_numbers_of_contact():
    with pytest.raises(InputError, match="have no numbers of contact"):
        roll().touch(False, friction=0.3)
    with pytest.raises(InputError, match=r"touch or they do not.*'no'"):
        roll().touch("no")
    model, _ = roll().touch().touch(False).build()
    assert "touch" not in model.laws


def test_searches_find_devices_with_contact():
    def build(rest=100.0):
        return roll(rest), Drive()

    way = Way(duration=0.3, rate=60.0)
    touching, apart = find(build, [{"rest": 100.0}, {"rest": 60.0}], way)
    assert "touch" in touching.model.laws and touching.motion is not None
    assert touching.motion.model.laws == touching.model.laws
    assert np.abs(touching.x - simulated(roll()).x[-1, :, 0]).max() < 1e-9
    assert apart.angle(0) == pytest.approx(simulated(roll(60.0)).creases[-1, 0, 0], abs=1e-6)

    slope = gradient(lambda rest: (closing(rest), Drive(load=1.0)), angle(0), {"rest": 3.3})
    assert 0.0 < slope.slope[0, 0] < 0.1  # contact holds it, which gives a little


def test_a_diagnosis_says_where_panels_came_near_each_other_in_a_recording():
    model, parameters = roll().touch(False).build()
    bare = simulate(model, parameters, duration=0.3, rate=60)
    recording = SimpleNamespace(name="rolled.csv", times=bare.times)

    class Recorded(Rollouts):
        _filmed = None  # pyright: ignore[reportAssignmentType]

        def __init__(self, sheet):
            self.model, self.parameters = sheet.build()
            self.recordings = [recording]  # pyright: ignore[reportAttributeAccessIssue]

        def recorded(self, r):
            return Motion(bare.x[:, :, 0])

    Recorded.__abstractmethods__ = frozenset()
    (note,) = meetings(Recorded(roll()))
    assert note.startswith("rolled.csv: panel 0 and panel 3 meet at t = 0.06") and "stiffness=0" in note
    assert meetings(Recorded(roll().touch())) == [] == meetings(Recorded(roll().touch(False)))


def test_a_path_keeps_panels_apart_from_where_they_meet():
    """Bars: two panels that are turned shut, in proportion to the load, and further."""
    s = Sheet(strip([10 * MM] * 2, 20 * MM), thickness=0.5 * MM, triangulation="diagonal")
    s.fix(panels=[0]).crease(stiffness=0.2e-3)
    s.set("crease_drive", drive_stiffness=0.2e-3, target_angle=3.1)
    shut = math.pi - 2 * math.asin(0.5 / 20)  # the far corners are a thickness apart

    def path(sheet, end=1.3):
        return continuation(*sheet.build(), Drive(load=1.0), end=end, step=0.1)

    found = path(s)
    assert found.reached and found.touching in found.message
    (factor,) = re.findall(r"panel 0 and panel 1 meet at the factor (\S+): contact .* without friction", found.touching)
    assert 3.1 * float(factor) == pytest.approx(shut, abs=1e-3)
    assert shut < found.angles[-1, 0] < shut + 0.01  # by which the drive presses them
    through = path(s.touch(False))
    assert through.touching == "" and through.angles[-1, 0] == pytest.approx(1.3 * 3.1)
    stated = path(s.touch(friction=0.0))
    assert stated.touching == "" and np.abs(stated.angles[-1] - found.angles[-1]).max() < 1e-9


def test_a_path_on_which_none_meet_is_that_without_contact():
    s = Sheet(strip([10 * MM] * 2, 20 * MM), thickness=0.5 * MM).fix(panels=[0]).crease(stiffness=0.2e-3)
    s.set("crease_drive", drive_stiffness=0.2e-3, target_angle=2.0)
    found, bare = (continuation(*one.build(), Drive(load=1.0)) for one in (s, s.touch(False)))
    assert np.array_equal(found.x, bare.x) and found.touching == ""
    model, parameters = s.build()
    assert len(found.state(-1).memory) == len(State.at_rest(model).memory)
    assert equilibrium(model, parameters, Drive(load=1.0), state=found.state(-1)).converged
