"""What nobody can mean is refused by one sentence: names, units, values and starts of the Python API."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, kresling, miura, ramp, si, sine, strip
from origami_sim.design.design_file import read_design
from origami_sim.errors import InputError, named_arguments
from origami_sim.quantities import converted, parsed
from origami_sim.units import in_unit, of_unit


def flap(**how) -> Sheet:
    return Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", **how)


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda: Drive(lod=1), r"Drive has no such argument; 'load' is near \(field 'lod', value 1\); allowed: field,"),
        (lambda: kresling(6, radius=0.1, height=0.1, twst=1.0), r"kresling has no such argument; 'twist' is near"),
        (lambda: kresling(6, radius=0.1, height=0.1, twist=1.0, base=1), r"field 'base', value 1.*n, radius, height"),
        (lambda: miura(2, 2, 0.01), r"miura cannot be stated so .*missing.*nx, ny, a, b, gamma"),
        (lambda: ramp(1.0, "1 s", strt=1.0), r"ramp has no such argument; 'start' is near"),
        (lambda: flap(thicknes=1.0), r"Sheet has no such argument; 'thickness' is near"),
        (lambda: flap(triangulation="centre"), r"field 'triangulation', value 'centre'\).*'center' is near"),
        (lambda: flap(material="papr"), r"unknown material; 'paper' is near \(field 'panel 0', value 'papr'\)"),
        (lambda: flap().patch(1, thickness=1e-3, material="mea"), r"unknown material; 'mae' is near"),
        (lambda: flap().shell(poisson="a"), r"not a number \(field 'poisson', value 'a'\); allowed: a number\.$"),
        (
            lambda: flap().shell(poisson=0.7),
            r"Poisson's ratio \(field 'poisson', value 0.7\); allowed: above -1, up to",
        ),
        (lambda: flap().shell(poisson=float("nan")), r"Poisson's ratio \(field 'poisson', value nan\)"),
        (lambda: Sheet(strip([0.01], 0.02), thickness=1e-3).crease(stiffness=1.0), r"the sheet has no creases"),
        (lambda: kresling(6, radius="20 mm", height="30", twist=0.5), r"without a unit \(field 'height', value '30'\)"),
        (lambda: Sheet(strip([0.01], 0.02), thickness=np.array(["1"])), r"without a unit.*'1 m', or the number alone"),
        (lambda: flap().crease(stiffness="2"), r"without a unit \(field 'stiffness'.*'2 N m/rad'"),
        (lambda: ramp("1 T", "1"), r"without a unit \(field 'duration', value '1'\)"),
        (
            lambda: Drive(load=ramp("1 N", "1 s")),
            r"wrong unit \(field 'load', value 'N'\); allowed: a factor on the loads",
        ),
        (lambda: Drive(field=(0, 0, sine("1 V", "1 Hz"))), r"wrong unit \(field 'field_z', value 'V'\).*signal in T"),
        (lambda: Drive(voltage=sine(["1 T", "2 T"], "1 Hz")), r"wrong unit \(field 'voltage.*value 'T'\).*signal in V"),
        (lambda: Drive().replace(field_x=ramp("1 V", "1 s")), r"wrong unit \(field 'field_x', value 'V'\)"),
        (lambda: ramp("1 T", "1 s", start="1 V"), r"units of two kinds \(field 'start', value 'V'\); allowed: T"),
    ],
)
def test_what_nobody_can_mean_is_one_sentence(state, said):
    with pytest.raises(InputError, match=said) as e:
        state()
    assert "\n" not in str(e.value) and len(str(e.value)) < 400


def test_what_can_be_meant_is_taken():
    assert Drive(load=ramp("50 %", "1 s"))["load"](2.0) == 0.5 == Drive(load=ramp(0.5, "1 s"))["load"](2.0)
    assert Drive(field=(0, 0, sine("50 mT", "1 Hz", offset=0.01)))["field_z"](0.25) == pytest.approx(0.06)
    assert Drive().replace(field_x="50 mT")["field_x"](0.0) == pytest.approx(0.05)
    assert converted("0.3", "1", "share") == 0.3 and converted("30", "SI", "any") == 30.0
    assert parsed("0.03", "m") == 0.03 and si("30") == 30.0  # the command line is SI
    none = Sheet(strip([0.01], 0.02), thickness=1e-3).crease([], stiffness=1.0)
    assert none.build()[0].creases.shape == (0, 4)
    flap().shell(poisson=0.5).crease(stiffness=1.0).build()


def test_a_design_file_is_refused_alike(tmp_path):
    text = 'pattern = { strip = { lengths = ["10", "20 mm"], width = "20 mm" } }\nsheet = { thickness = "1 mm" }\n'
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=r"a\.toml.*without a unit"):
        read_design(tmp_path / "a.toml")


def test_a_function_that_names_its_arguments_is_otherwise_the_same():
    @named_arguments
    def area(width: float, height: float = 2.0) -> float:
        """The area."""
        return width * height

    assert area(3.0) == 6.0 == area(height=3.0, width=2.0) and area.__doc__ == "The area."
    with pytest.raises(InputError, match="area has no such argument; 'height' is near"):
        area(1.0, heigth=2.0)  # type: ignore[call-arg]


def test_plain_numbers_have_no_unit_to_be_named():
    assert in_unit("a number", "mm") == "a number in mm" and in_unit("a number", "1") == "a number"
    assert of_unit("1 to 1000", "1") == "1 to 1000" and of_unit("0 to 5", "mm") == "0 to 5 mm"
