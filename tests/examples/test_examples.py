"""Every example draws its picture, and its numbers have the property that the gallery states."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples"
EXAMPLES = sorted(FOLDER.glob("[0-9]*.py"))
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
MOST_BYTES = 120_000


def bounded_by_safe(largest, least_ratio, **at_most):
    assert largest["vices"] > least_ratio * largest["safe"]
    assert largest["safe"] < at_most["safe"]


def check_push(largest):
    bounded_by_safe(largest, 2.0, safe=0.01)


def check_wiping(left):
    assert left < 0.05


def check_many(left):
    assert left.shape == (16,)
    assert left.mean() < 0.8


def check_box(lasting):
    bounded_by_safe(lasting, 5.0, safe=10.0)


def check_bottle(steady):
    bounded_by_safe(steady, 3.0, safe=12.0)


def check_observer(rise):
    assert rise["paper"] > 5 * rise["safe"]
    assert 0.005 < rise["safe"] < 0.08


def check_delays(delays):
    for slower, faster in zip(delays["paper"], delays["safe"], strict=True):
        assert faster < 0.1
        assert slower > 3 * faster
    assert (np.diff(delays["paper"]) < 0).all()


def check_elbow(moved):
    assert moved["elbow"] > 0.1
    assert moved["tool"] < 0.02


def check_pressing(largest):
    bounded_by_safe(largest, 3.0, safe=45.0)


def check_reach(fastest):
    assert fastest["safe"] < 1.0 < fastest["vices"]


def check_load(end):
    assert end["not told"] > 0.03  # 25 N on 570 N/m
    assert max(end["told"], end["estimated after 2 s"]) < 0.005


def check_lost(off):
    assert off[20] < 0.005
    assert off[60] > 0.05


def check_seen(grid):
    assert (grid >= 0).all()
    assert 0 < np.count_nonzero(grid) < grid.size


def check_spiral(found):
    assert found["force"] < 40


CHECKS = {
    "01_controller_alone": check_push,
    "02_environment": check_wiping,
    "03_many_environments": check_many,
    "04_your_own_scene": check_box,
    "05_forearm_meets_bottle": check_bottle,
    "06_what_the_observer_sees": check_observer,
    "07_how_soon_a_push_is_noticed": check_delays,
    "08_elbow_moves_tool_stays": check_elbow,
    "09_pressing_the_table": check_pressing,
    "10_out_of_reach": check_reach,
    "11_a_load_nobody_mentioned": check_load,
    "12_measurements_are_lost": check_lost,
    "13_what_the_policy_sees": check_seen,
    "14_spiral_search": check_spiral,
}


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_draws_its_picture_and_keeps_what_it_says(path, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    found = load(path).main(tmp_path)
    assert capsys.readouterr().out.strip()
    (picture,) = tmp_path.iterdir()
    assert picture.name == f"{path.stem}.png"
    assert picture.stat().st_size < MOST_BYTES
    pixels = imread(picture)
    assert min(pixels.shape[:2]) > 200
    assert len(np.unique(pixels.reshape(-1, pixels.shape[-1]), axis=0)) > 10
    CHECKS[path.stem](found)


def test_every_example_is_in_the_gallery_once_and_checked():
    names = [path.stem for path in EXAMPLES]
    assert sorted(re.findall(r"\]\(gallery/(\w+)\.png\)", PAGE)) == names == sorted(CHECKS)
    assert all(PAGE.count(f"<../examples/{name}.py>") == 1 for name in names)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_is_short_and_says_what_its_picture_shows(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 80
    assert any(line.startswith("Picture: ") for line in lines[:4])
