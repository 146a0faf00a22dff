"""Text of the kernels around the laws of the effects: arguments, time loops, what is done with the forces."""

_ARGUMENTS = """
    mask: wp.array(dtype=vec3), bars: wp.array(dtype=wp.vec2i), hinges: wp.array(dtype=wp.vec4i),
    electrodes: wp.array(dtype=wp.int32), triangles: wp.array(dtype=wp.vec3i),
    magnets: wp.array(dtype=wp.int32),
    contacts: wp.array(dtype=wp.vec3i), weights: wp.array(dtype=vec3), offsets: wp.array(dtype=scalar),
    axes: wp.array(dtype=vec3), crease_count: int,
    P: wp.array(dtype=scalar), layout: wp.array2d(dtype=wp.int32),
    series_times: wp.array(dtype=scalar), series_values: wp.array3d(dtype=scalar),
    memory_rows: wp.array(dtype=wp.int32), active: wp.array2d(dtype=wp.int64),{sources}{plates}{skin}
    X: wp.array2d(dtype=vec3), V: wp.array2d(dtype=vec3), angles: wp.array2d(dtype=scalar),
    memory: wp.array2d(dtype=scalar),
"""


HALT = """        if pressed >= 0 and limit < scalar(wp.inf):  # without a limit nothing stops a world
            fastest = pressed"""

HALT_RIGID = """                if pressed >= 0:  # by the end of the step; a step that is taken back says nothing
                    status[0, w] = first_step + wp.max(s, 0) + 1
                    status[1, w] = pressed
                    going = int(0)"""

GRIPS = {
    "extra": "\n    grips: clamps.Grips,",
    "put": """
        begins = int(0)
        if s < 0:
            begins = int(1)
        clamps.place(grips, X, V, mask, work, P, {mass}, time, begins, w)""",
    "counted": """
        clamps.count(grips, F, V, mask, work, power, half, w)""",
    "posed": """articulated.pose_root(tree, w)
                clamps.root(grips, tree, time, w)
                articulated.pose_rest(tree, w)
                clamps.aim(grips, tree, time, w)""",
    "supported": """
                if stage >= first_stage:
                    supporting = clamps.support(grips, tree, slot, w)
                    spent = w * tree.width + tree.spent + grips.row
                    tree.data[spent & NATURAL] = tree.data[spent & NATURAL] + weighs * supporting
                    if last:
                        power[grips.row, w] = supporting""",
}
"""What kernels have in addition where grips move."""

STANDING = {**dict.fromkeys(GRIPS, ""), "posed": "articulated.pose(tree, w)"}
"""The same where none does."""

SWEPT_RIGID = """                error = runge_kutta.larger(error, allowed * wp.pow(swept, scalar(5.0)))"""


def arguments(shells: bool, sources: bool, touches: bool) -> str:
    """Arguments that all kernels begin with; rows of curvature of sheets, the surface of what touches among them.

    Those of laws that ask for the gradient of the field have its sources.
    """
    return _ARGUMENTS.format(
        plates="\n    plates: shells.Plates," if shells else "",
        sources="\n    sources: fields.Sources," if sources else "",
        skin="\n    skin: touching.Skin," if touches else "",
    )


ROLLOUT = """
@wp.kernel(enable_backward=False)
def rollout({arguments}
    A: wp.array2d(dtype=vec3), F: wp.array2d(dtype=vec3), work: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar), status: wp.array2d(dtype=wp.int32),
    first_world: int, first_step: int, steps: int, dt: scalar, speed_limit: scalar,
    every: int, film: wp.array3d(dtype=vec3), film_angles: wp.array3d(dtype=scalar), carried: wp.array3d(dtype=vec3),
    noted: wp.array(dtype=wp.int32), notes: wp.array3d(dtype=scalar),{extra}
):
    w = (first_world + wp.tid()) & NATURAL
    if status[0, w] >= 0:
        return
    frame = int(0)
    note = int(0)
    wait = every
{hoist}
    half_dt = scalar(0.5) * dt
    limit = speed_limit * speed_limit
    fastest = int(-1)
    # one pass more than steps: at the start of a run the first pass only finds the acceleration
    begin = int(0)
    if first_step < 0:
        begin = int(-1)
    start = wp.max(first_step, 0)
    for s in range(begin, steps):
        h = dt
        half = half_dt
        if s < 0:
            h = scalar(0.0)
            half = scalar(0.0)
        time = dt * scalar(start + s + 1)
        if s >= 0 and s < carried.shape[0]:  # nodes that are held follow a prescribed motion
            for row in range(mask.shape[0]):
                n = row & NATURAL
                V[n, w] = carried[s, n, w % carried.shape[2]]
        # kick and drift; v becomes the prediction of the velocity at the end of the step
        for row in range(mask.shape[0]):
            n = row & NATURAL
            ahead = V[n, w] + half * A[n, w]
            X[n, w] = X[n, w] + h * ahead
            V[n, w] = ahead + half * A[n, w]
            F[n, w] = vec3(scalar(0.0), scalar(0.0), scalar(0.0)){put}
{body}{counted}
        # second kick, with the new acceleration
        for row in range(mask.shape[0]):
            n = row & NATURAL
            new = wp.cw_mul(mask[n], F[n, w]) * (scalar(1.0) / {mass})
            V[n, w] = V[n, w] + half * (new - A[n, w])
            A[n, w] = new
            speed = wp.dot(V[n, w], V[n, w])
            if not (speed <= limit):  # also true for nan
                fastest = n
                limit = wp.max(speed, limit)  # so that the fastest is named{halt}
        if fastest >= 0:
            status[0, w] = start + s + 1
            status[1, w] = fastest
            break
        if s >= 0 and every > 0:
            wait -= 1
            if wait == 0:
                for row in range(mask.shape[0]):
                    film[frame, row, w] = X[row, w]
                for row in range(hinges.shape[0]):
                    film_angles[frame, row, w] = angles[row, w]
                frame += 1
                wait = every
        if note < noted.shape[0] and s >= 0:
            if noted[note] == s + 1:  # what laws remember after so many steps
                for row in range(notes.shape[1]):
                    notes[note, row, w] = memory[row, w]
                note += 1
"""

EVALUATE = """
@wp.kernel(enable_backward=False)
def evaluate({arguments}
    forces: wp.array3d(dtype=vec3), energies: wp.array2d(dtype=scalar), gaps: wp.array2d(dtype=scalar),
    first_world: int, time: scalar,
):
    w = (first_world + wp.tid()) & NATURAL
    h = scalar(0.0)
{hoist}
{body}
"""

TOTAL = """
@wp.kernel(enable_backward=False)
def total({arguments}
    F: wp.array2d(dtype=vec3), first_world: int, time: scalar,
):
    w = (first_world + wp.tid()) & NATURAL
    h = scalar(0.0)
    for row in range(mask.shape[0]):
        n = row & NATURAL
        F[n, w] = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
{hoist}
{body}
"""

RIGID = """
@wp.kernel(enable_backward=False)
def rigid({arguments}
    tree: articulated.Tree, F: wp.array2d(dtype=vec3), work: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar), status: wp.array2d(dtype=wp.int32),
    first_world: int, first_step: int, fresh: int, steps: int, dt: scalar, tolerance: scalar, size: scalar,
    finest: scalar, every: int, film: wp.array3d(dtype=vec3), film_angles: wp.array3d(dtype=scalar),{extra}
):
    w = (first_world + wp.tid()) & NATURAL
    if status[0, w] >= 0:
        return
    frame = int(0)
    wait = every
{hoist}
{steady}
    asked = int(0)  # nodes that laws ask for
    if {cornered}:
        asked = tree.corners
    if {nodal}:
        asked = tree.moving.shape[0]
    final = int(tree.stages - 1)
    anew = int(0)
    # one pass more than steps: at first only the accelerations are found
    begin = int(0)
    if fresh == 1:
        begin = int(-1)
    for s in range(begin, steps):
        clock = scalar(0.0)
        until = scalar(wp.inf)  # when a hinge reverses
        going = int(1)
        still = int(0)  # a pass that finds accelerations and takes no time
        if s < 0:
            still = int(1)
        elif anew < tree.restarts.shape[0]:
            if s == tree.restarts[anew]:
                runge_kutta.restart(tree, angles, memory, anew, w)
                anew += 1
                still = int(1)
        while going == 1:
            step = runge_kutta.step_of(tree, clock, dt, tolerance, w)
            ends = int(0)
            cut = int(0)
            if step == dt - clock:
                ends = int(1)
                cut = int(1)
            if until < step:
                step = until
                ends = int(0)
                cut = int(1)
            first_stage = int(1)
            if still == 1:
                step = scalar(0.0)
                first_stage = final
            runge_kutta.begin(tree, angles, memory, power, w)
            probes = int(0)
            if tree.implicit.shape[0] > 0 and still == 0:
                # the damping that steps are implicit in is found now and then, and after a step that failed
                if runge_kutta.is_stale(tree, w):
                    probes = tree.rates + 2
            for stage in range(first_stage - probes, final + 1):
                h = scalar(0.0)
                weighs = scalar(0.0)
                slot = int(stage)
                if stage < first_stage:
                    slot = int(tree.stages)
                    runge_kutta.probe(tree, first_stage - 1 - stage, size, w)
                else:
                    if still == 0:
                        if stage == first_stage and tree.implicit.shape[0] > 0:
                            runge_kutta.begin_damped(tree, step, w)
                        runge_kutta.go(tree, stage, step, w)
                    h = articulated.at(tree.tableau, stage * (tree.stages + 1)) * step
                    weighs = articulated.at(tree.tableau, final * (tree.stages + 1) + 1 + stage)
                time = dt * scalar(first_step + wp.max(s, 0)) + clock + h
                last = stage == final
                {posed}
                laid = asked
                if still == 1 or (last and ends == 1):  # a film needs them where a frame ends
                    laid = tree.moving.shape[0]
                articulated.place(tree, X, V, F, laid, w)
{body}
                articulated.gather(tree, F, X, asked, w)
                articulated.accelerate(tree, slot, w){supported}
                if stage < first_stage:
                    runge_kutta.probed(tree, first_stage - 1 - stage, size, w)
            allowed = tolerance
            if tolerance == scalar(0.0):
                allowed = scalar(1.0)  # a step as given only may not turn anything by radians more than it should
            error = scalar(0.0)
            longer = dt
            until = scalar(wp.inf)
            if still == 0:
                error = runge_kutta.error_of(tree, step, size, w){swept}
                if tolerance > scalar(0.0) and tree.memories > 0 and error <= allowed:
                    until = runge_kutta.reversal(tree, step, tolerance, w)
            if error <= allowed and until > step:
                runge_kutta.carry_over(tree, work, step, w)
                clock += step
                if s < 0 or (still == 0 and ends == 1):
                    going = int(0)
                if still == 0 and tolerance > scalar(0.0):
                    longer = runge_kutta.lengthen(tree, step, error / allowed, cut, w)
                still = int(0){halt}
            else:
                runge_kutta.doubt(tree, w)
                runge_kutta.go_back(tree, angles, memory, power, w)
                if not (error <= allowed):
                    longer = scalar(0.0)
                    if tolerance > scalar(0.0):
                        longer = runge_kutta.lengthen(tree, step, error / allowed, 0, w)
            if longer <= finest:
                status[0, w] = first_step + s + 1
                articulated.place(tree, X, V, F, tree.moving.shape[0], w)
                status[1, w] = runge_kutta.fastest(V, w)
                going = int(0)
        if status[0, w] >= 0:
            break
        if s >= 0 and every > 0:
            wait -= 1
            if wait == 0:
                for row in range(mask.shape[0]):
                    film[frame, row, w] = X[row, w]
                for row in range(hinges.shape[0]):
                    film_angles[frame, row, w] = angles[row, w]
                frame += 1
                wait = every
"""
