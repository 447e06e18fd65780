"""Pictures of the gallery are drawn once, and again when their source changes."""

import pytest
from tests.docs import program


@pytest.fixture
def pictures(tmp_path, monkeypatch):
    module = program("pictures")
    examples = tmp_path / "examples"
    examples.mkdir()
    (examples / "shared_by_examples.py").write_text("TEXT = 'drawn'\n", encoding="utf-8")
    for name in ("01_first", "02_second"):
        (examples / f"{name}.py").write_text(
            "from pathlib import Path\n"
            "from shared_by_examples import TEXT\n"
            "def main(folder): (Path(folder) / f'{Path(__file__).stem}.png').write_text(TEXT)\n",
            encoding="utf-8",
        )
    monkeypatch.setattr(module, "SOURCES", examples)
    monkeypatch.setattr(module, "EXAMPLES", sorted(examples.glob("[0-9]*.py")))
    monkeypatch.setattr(module, "FOLDER", tmp_path / "gallery")
    monkeypatch.setattr(module, "_DIGESTS", tmp_path / "gallery" / "digests.json")
    monkeypatch.syspath_prepend(str(examples))
    return module


def names(pictures, all_of_them=False):
    return [path.stem for path in pictures.stale(all_of_them)]


def test_all_are_drawn_at_first_and_none_again(pictures):
    assert names(pictures) == ["01_first", "02_second"]
    pictures.draw(pictures.stale())
    assert (pictures.FOLDER / "01_first.png").read_text() == "drawn"
    assert names(pictures) == []
    assert names(pictures, all_of_them=True) == ["01_first", "02_second"]


def test_one_whose_source_changed_or_whose_picture_is_gone_is_drawn_again(pictures):
    pictures.draw(pictures.stale())
    path = pictures.SOURCES / "01_first.py"
    path.write_text(path.read_text() + "# changed\n", encoding="utf-8")
    assert names(pictures) == ["01_first"]
    (pictures.FOLDER / "02_second.png").unlink()
    assert names(pictures) == ["01_first", "02_second"]


def test_all_are_drawn_again_when_what_they_share_changed(pictures):
    pictures.draw(pictures.stale())
    (pictures.SOURCES / "shared_by_examples.py").write_text("TEXT = 'anew'\n", encoding="utf-8")
    assert names(pictures) == ["01_first", "02_second"]
