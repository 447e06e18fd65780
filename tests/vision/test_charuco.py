"""The printed target: what is on the page is what is looked for, true to size, and nothing is half written."""

import re
import struct
import zlib

import numpy as np
import pytest

from contactsafe.core.errors import InvalidInputError, OutputError

pytest.importorskip("cv2")

import cv2
from tests.vision.rendered import TARGET, page

from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.sheet import write_sheet


@pytest.mark.parametrize(
    ("target", "paper", "size"),
    [
        (TARGET, "A4", (297, 210)),
        (CharucoTarget(6, 4, 0.06), "A3", (420, 297)),
        (CharucoTarget(9, 6, 0.08), "A1", None),
    ],
)
def test_the_page_shows_every_corner_where_the_target_has_it(tmp_path, target, paper, size):
    if size is None:
        assert write_sheet(target, tmp_path / "a.pdf") == paper
        return
    assert write_sheet(target, tmp_path / "a.png") == paper
    picture = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_GRAYSCALE)
    assert picture.shape == (10 * size[1], 10 * size[0])
    found = target.find(picture)
    assert sorted(found.ids) == list(range((target.columns - 1) * (target.rows - 1)))
    x, y, z = target.points(found.ids).T
    printed = np.column_stack([10 * (1000 * x + size[0] / 2), 10 * (size[1] / 2 - 1000 * y)]) - 0.5
    np.testing.assert_allclose(found.pixels, printed, atol=0.3)
    assert (z == 0.0).all()


def test_the_pattern_is_opencvs_own():
    """Users of other programs may read it."""
    pattern = cv2.aruco.CharucoBoard((7, 5), 0.036, 0.027, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    theirs = pattern.generateImage((504, 360), marginSize=0)
    ours = page()[30:-30, 45:-45]
    assert (np.abs(cv2.resize(ours, (504, 360)).astype(int) - theirs) > 128).mean() < 0.03


def test_the_page_of_pdf_has_its_paper_size_and_every_rectangle(tmp_path):
    write_sheet(TARGET, tmp_path / "a.pdf")
    data = (tmp_path / "a.pdf").read_bytes()
    box = [float(word) for word in re.search(rb"/MediaBox \[([\d. ]+)\]", data)[1].split()]
    np.testing.assert_allclose(box, [0.0, 0.0, 297 * 72 / 25.4, 210 * 72 / 25.4], atol=1e-3)
    drawn = zlib.decompress(re.search(rb"stream\n(.*?)\nendstream", data, re.DOTALL)[1]).decode()
    rectangles = [[float(word) for word in line.split()[:4]] for line in drawn.splitlines() if line.endswith(" re")]
    middle = np.array(rectangles)[: len(TARGET.rectangles())] * 25.4 / 72 / 1000 - [0.1485, 0.105, 0.0, 0.0]
    np.testing.assert_allclose(middle, TARGET.rectangles(), atol=1e-6)
    assert "square 36 mm; print on A4 at 100 %" in drawn
    for number, place in enumerate(re.findall(rb"(\d{10}) 00000 n", data), 1):
        assert data[int(place) :].startswith(b"%d 0 obj" % number)


def test_the_png_says_how_large_it_is(tmp_path):
    write_sheet(TARGET, tmp_path / "a.png")
    data = (tmp_path / "a.png").read_bytes()
    place = data.index(b"pHYs")
    assert struct.unpack(">IIB", data[place + 4 : place + 13]) == (10000, 10000, 1)
    assert struct.unpack(">I", data[place + 13 : place + 17])[0] == zlib.crc32(data[place : place + 13])


@pytest.mark.parametrize(("change", "told"), [
    ({"columns": 2}, "give 3 or more each"),
    ({"columns": 20, "rows": 20}, "100 at most in all"),
    ({"square_m": 0.001}, "give 5 to 500 mm"),
    ({"square_m": float("nan")}, "give 5 to 500 mm"),
])  # fmt: skip
def test_what_is_no_target_is_refused(change, told):
    with pytest.raises(InvalidInputError, match=told):
        CharucoTarget(**change)


def test_a_page_that_cannot_be_is_refused_and_nothing_is_left(tmp_path):
    with pytest.raises(InvalidInputError, match=r"is no \.pdf or \.png"):
        write_sheet(TARGET, tmp_path / "a.jpg")
    with pytest.raises(InvalidInputError, match="fewer or smaller squares"):
        write_sheet(CharucoTarget(9, 6, 0.3), tmp_path / "a.pdf")
    with pytest.raises(OutputError):
        write_sheet(TARGET, tmp_path / "nowhere" / "a.pdf")
    assert list(tmp_path.iterdir()) == []
