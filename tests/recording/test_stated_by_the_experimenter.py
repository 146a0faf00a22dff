"""What a sidecar states of a recording beside its channels: noise with units, gravity, starts, priors, markers."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.recording import Gravity, Recording, Start, read_dataset, read_recording

TIMES = np.arange(40) / 100.0
BODY = """
[time]
column = "t"
[channels.fold]
column = "a"
kind = "crease_angle"
unit = "deg"
crease = "hip"
noise = NOISE
[channels.tip]
columns = ["x", "y", "z"]
kind = "marker"
unit = "mm"
panel = 1
PLACE
"""


@pytest.fixture
def read(tmp_path):
    """Reads a recording whose sidecar begins with a text."""

    def recorded(
        head: str = "", *, noise: str = "0.5", place: str = "", name: str = "run", body: str = ""
    ) -> Recording:
        rows = [f"{t},{20 * np.cos(9 * t)},{t},{2 * t},{np.sin(9 * t)}" for t in TIMES + (name != "run")]
        path = tmp_path / f"{name}.csv"
        path.write_text("\n".join(["t,a,x,y,z", *rows]))
        text = body or BODY.replace("NOISE", noise).replace("PLACE", place)
        path.with_suffix(".toml").write_text(head + text)
        return read_recording(path)

    return recorded


@pytest.mark.parametrize(
    "noise, expected", [("0.5", np.deg2rad(0.5)), ('"0.4 mrad"', 4e-4), ('"0.5 deg"', np.deg2rad(0.5))]
)
def test_noise_may_have_a_unit_of_its_own(read, noise, expected):
    assert read(noise=noise).channels["fold"].noise == pytest.approx(expected, rel=1e-12)


def test_noise_of_pixels_may_be_in_pixels_or_in_lengths(read):
    body = """
[time]
column = "t"
[cameras.side]
scale = 2e-4
[channels.tip]
columns = ["x", "y"]
kind = "marker_2d"
unit = "px"
node = 3
noise = NOISE
"""
    for noise, expected in (("0.5", 1e-4), ('"0.5 px"', 1e-4), ('"0.1 mm"', 1e-4)):
        found = read(body=body.replace("NOISE", noise)).channels["tip"].noise
        assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "text, direction, size",
    [
        ("gravity = [0.0, 0.0, -9.81]", (0, 0, -1), 9.81),
        ("gravity = [3.0, 0.0, -4.0]", (0.6, 0, -0.8), 5.0),
        ("gravity = [0.0, 0.0, 0.0]", (0, 0, -1), 0.0),
        ('gravity = { pose = "hanging", down = [0.0, 2.0, 0.0] }', (0, 1, 0), None),
        ('gravity = { pose = "upside down", down = [0.0, 2.0, 0.0], size = 9.8 }', (0, -1, 0), 9.8),
        ('gravity = { pose = "lying", face = [1.0, 0.0, 0.0], size = "1 g0" }', (1, 0, 0), 9.80665),
    ],
)
def test_gravity_is_a_vector_or_a_pose(read, text, direction, size):
    found = read(text).gravity
    np.testing.assert_allclose(found.direction, direction, atol=1e-12)
    assert found.size == pytest.approx(size)
    assert np.linalg.norm(found.vector(9.7)) == pytest.approx(9.7 if size is None else size)


def test_recordings_of_one_object_may_lie_and_hang(read, tmp_path):
    read('gravity = { pose = "lying", face = [1.0, 0.0, 0.0] }', name="run")
    read('gravity = { pose = "hanging", down = [0.0, 0.0, -1.0] }\nstart = "moving"', name="other")
    data = read_dataset(tmp_path)
    assert [r.gravity.words for r in data] == ["hanging", "lying"]
    assert [r.start is None for r in data] == [False, True]


def test_a_start_is_a_word_or_says_angles(read):
    assert read('start = "moving"').start == Start("moving")
    head = 'start = { state = "released", angles = { hip = "20 deg", 1 = 0.1 }, sd = "0.01 rad", rate_sd = "1 deg/s" }'
    start = read(head).start
    assert start.angles == {"hip": pytest.approx(np.deg2rad(20)), "1": 0.1}
    assert (start.sd, start.rate_sd) == (0.01, pytest.approx(np.deg2rad(1)))


def test_a_part_of_a_recording_begins_as_it_does_only_with_its_first_frame(read):
    recording = read('start = "released"')
    assert recording.window(0.0, 0.2).start == Start("released")
    assert recording.window(0.1, 0.3).start is None


def test_priors_may_be_tables(read):
    priors = """
[priors]
mass_1 = { sd = "0.5 g" }
"crease.stiffness[hip]" = { factor = 1.2 }
"crease.rest_angle[hip]" = { sd = "0.02 rad" }
length = { sd = 0.001 }
"""
    found = read(body=BODY.replace("NOISE", "0.5").replace("PLACE", "") + priors).metadata["priors"]
    assert found["mass_1"] == "0.5 g" and found["length"] == 0.001
    assert float(found["crease.stiffness[hip]"].removesuffix(" %")) == pytest.approx(50 * (1.2 - 1 / 1.2))
    assert found["crease.rest_angle[hip]"] == "0.02 rad"


@pytest.mark.parametrize(
    "options, words",
    [
        ({"noise": '"0.4"'}, r"text with a unit.*channels\.fold\.noise.*0\.4"),
        ({"noise": '"0.4 mm"'}, r"unknown unit of angle.*channels\.fold\.noise.*mm"),
        ({"noise": '"-1 mrad"'}, "noise must be positive"),
        ({"noise": '"1 px"'}, "only readings in px"),
        ({"head": "gravity = 9.81"}, "three components or a pose.*gravity.*9.81"),
        ({"head": "gravity = [0.0, 9.81]"}, "three numbers.*gravity"),
        ({"head": "gravity = [0.0, 0.0, -9810.0]"}, "no gravity is that large"),
        ({"head": 'gravity = { pose = "floating" }'}, r"unknown pose.*gravity\.pose.*floating.*hanging, upside down"),
        ({"head": 'gravity = { pose = "hanging" }'}, r"needs 'down'.*gravity\.down"),
        ({"head": 'gravity = { pose = "lying", down = [1.0, 0.0, 0.0] }'}, r"needs 'face'.*gravity\.face"),
        (
            {"head": 'gravity = { pose = "hanging", down = [0, 0, -1], face = [1, 0, 0] }'},
            r"is not for 'hanging'.*gravity\.face",
        ),
        ({"head": 'gravity = { pose = "hanging", down = [0.0, 0.0, 0.0] }'}, r"not be zero.*gravity\.down"),
        ({"head": 'start = "resting"'}, r"unknown state.*start\.state.*resting.*released, equilibrium, moving"),
        ({"head": 'start = { state = "released", angles = { hip = 0.1 } }'}, r"need a standard deviation.*start\.sd"),
        ({"head": 'start = { state = "moving", angles = { hip = 0.1 } }'}, r"those of a release.*start\.angles"),
        ({"head": 'start = { state = "released", angles = { hip = "1 mm" }, sd = 0.01 }'}, r"start\.angles\.hip"),
        ({"head": 'start = { state = "equilibrium", sd = -0.1 }'}, r"positive number in rad.*start\.sd"),
        ({"head": 'start = { state = "released", sd = 0.1 }'}, r"released angles or of an equilibrium.*start\.sd"),
        ({"head": 'start = { state = "released", rate_sd = "1 rad" }'}, r"must be a rate.*start\.rate_sd"),
        ({"head": 'priors = { mass = { sd = 1.0, factor = 2.0 } }'}, r"sd or factor.*priors\.mass"),
        ({"head": 'priors = { mass = { factor = 0.9 } }'}, r"above 1.*priors\.mass\.factor"),
        ({"place": 'from = "hip"'}, r"needs its distance.*channels\.tip\.distance"),
        ({"place": "distance = 0.01"}, r"'from' is missing.*channels\.tip\.distance"),
        ({"place": 'from = "hip"\npoint = [0, 0, 0]\ndistance = 0.1'}, r"in place of 'point'.*tip\.from"),
        ({"place": 'from = "hip"\ndistance = "5 mrad"'}, r"unknown unit of length.*channels\.tip\.distance"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_sentence(read, options, words):
    with pytest.raises(InputError, match=words) as caught:
        read(**options)
    assert "run.toml" in str(caught.value) and "\n" not in str(caught.value)


def test_a_curve_has_no_start(read):
    with pytest.raises(InputError, match="quasi-static curve has no start"):
        read(
            'start = "moving"',
            body=BODY.replace("NOISE", "0.5").replace("PLACE", "").replace('[time]\ncolumn = "t"', ""),
        )


def test_gravity_is_as_large_as_the_model_has_it_where_no_size_is_stated():
    pose = Gravity((0.0, 0.0, 1.0), None, "upside down")
    np.testing.assert_allclose(pose.vector(9.81), (0, 0, 9.81))
