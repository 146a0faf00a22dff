"""The files of ORIPA: Java beans as XML."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.folding import fold, read
from origami_sim.pattern import read_opx, read_pattern

LINES = [
    (1, -2, -2, 2, -2), (1, 2, -2, 2, 2), (1, 2, 2, -2, 2), (1, -2, 2, -2, -2),
    (3, -2, -2, 2, 2), (3, -2, 2, 2, -2), (2, -2, 0, 2, 0), (0, 0, -2, 1, 2),
]  # fmt: skip


def bean(*, kind, **numbers) -> str:
    """A line as ORIPA saves it: what is zero is left out."""
    ends = "".join(
        f'<void property="{n}"><double>{v}</double></void>' for n, v in numbers.items() if not (v == 0 and n != "x0")
    )
    return f'<object class="oripa.OriLineProxy"><void property="type"><int>{kind}</int></void>{ends}</object>'


def saved(folder, beans):
    file = folder / "base.opx"
    lines = "".join(f'<void index="{n}">{b}</void>' for n, b in enumerate(beans))
    file.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><java version="1.6.0" class="java.beans.XMLDecoder">'
        '<object class="oripa.DataSet"><void property="lines"><array class="oripa.OriLineProxy" length="8">'
        f'{lines}</array></void><void property="paperSize"><double>4.0</double></void></object></java>'
    )
    return file


def test_it_folds(tmp_path):
    beans = [bean(kind=k, x0=a, y0=b, x1=c, y1=d) for k, a, b, c, d in LINES]
    pattern = read(saved(tmp_path, beans), size=0.1)
    assert len(pattern.faces) == 6 and np.ptp(pattern.vertices[:, 0]) == pytest.approx(0.1)
    assert any("1 auxiliary lines were left out" in n for n in pattern.notes)
    assert fold(pattern).reached


@pytest.mark.parametrize(
    ("beans", "words"),
    [
        ([bean(kind=9, x0=0, y0=0, x1=1, y1=1)], "line 0.*9.0.*0, 1, 2 or 3"),
        ([bean(kind=1, x0="a", y0=0, x1=1, y1=1)], "'x0' is no number.*line 0"),
        ([bean(kind=1, x0="nan", y0=0, x1=1, y1=1)], "'x0' is no number"),
        ([], "no border, mountain or valley"),
        ([bean(kind=0, x0=0, y0=0, x1=1, y1=1)], "no border, mountain or valley"),
        (["<object"], "malformed XML"),
    ],
)
def test_bad_files(tmp_path, beans, words):
    with pytest.raises(InputError, match=words):
        read_opx(saved(tmp_path, beans))


def test_entities_are_refused(tmp_path):
    file = tmp_path / "a.opx"
    file.write_text('<!DOCTYPE java [<!ENTITY a "b">]><java>&a;</java>')
    with pytest.raises(InputError, match="entity"):
        read_pattern(file)
