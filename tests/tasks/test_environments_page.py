"""What the page of the environments lists is what they give."""

import re
from pathlib import Path

import gymnasium
import pytest

import contactsafe  # noqa: F401  registers the environments
from contactsafe.tasks.wiping.camera import INK_PIXEL, OTHER_PIXEL

PAGE = (Path(__file__).parents[2] / "docs" / "concepts" / "environments.md").read_text(encoding="utf-8")


def table(task, name):
    """Return the rows of a task's table by their first cell, without its marks."""
    section = PAGE.partition(f"\n## {task}\n")[2].partition("\n## ")[0]
    lines = section.partition(f"| {name} |")[2].partition("\n\n")[0].splitlines()[2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {cells[0].strip("`"): cells[1:] for cells in rows}


@pytest.mark.parametrize("task", ["Wiping", "Insertion"])
def test_the_page_lists_what_the_environment_gives(task):
    env = gymnasium.make(f"contactsafe/{task}-v0")
    env.reset(seed=0)
    *_, info = env.step(env.action_space.sample())
    spaces, vectors = env.observation_space, {vector.name: vector for vector in env.unwrapped.observation_vectors}
    rows = table(task, "observation")
    assert {name: tuple(map(int, re.findall(r"\d+", cells[0]))) for name, cells in rows.items()} == {
        name: space.shape for name, space in spaces.items()
    }
    assert {name: rows[name][1:] for name in vectors} == {n: [vector.unit, vector.doc] for n, vector in vectors.items()}
    assert set(table(task, "info")) == set(info)
    env.close()


def test_the_page_says_which_pixels_are_ink_which_it_had_the_wrong_way_round():
    said = re.search(r"(\d+) where ink .* is seen, else (\d+)", table("Wiping", "observation")["mask"][-1])
    assert (int(said[1]), int(said[2])) == (INK_PIXEL, OTHER_PIXEL)
