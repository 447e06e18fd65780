"""Boards under arms that are driven by hand: erased as the task erases, seen as its camera sees."""

import numpy as np
from tests.sim.scenes import CALM, panda, run, worlds_at

from contactsafe.sim.worlds import MAX_TICKS, Worlds
from contactsafe.tasks.wiping.board import BoardConfig, Camera, furnish, pad_half
from contactsafe.tasks.wiping.whiteboards import Whiteboards

BOARD = BoardConfig()
CAMERA = Camera()


class Scene:
    """Worlds and their boards, each of which keeps its ink until a pad wipes it off."""

    def __init__(self, worlds):
        self.worlds = worlds
        self.boards = Whiteboards(BOARD, CAMERA, worlds.models, pad_half(panda()))
        self.board = self.boards.boards[0]

    def mask(self):
        """What the camera sees of the first board."""
        return self.boards.render(self.worlds.records)[0]

    def place(self, q):
        """Put the first arm somewhere for a picture."""
        self.worlds.place(0, q)

    def wipe(self, ticks):
        """Run this many ticks in the first world, erasing; return their records."""
        worlds, boards, rows = self.worlds, self.boards, []
        while ticks > 0:
            count = min(ticks, MAX_TICKS)
            rows.append(run(worlds, count)[0])
            boards.erase(0, 1, worlds)
            ticks -= count
        return np.concatenate(rows)


def scene(config=CALM):
    """Make one arm at no particular place."""
    return Scene(Worlds(panda(), furnish(config, BOARD)))


def scene_at(position, config=CALM):
    """Make one arm at rest with its tool at a place."""
    return Scene(worlds_at(position, furnish(config, BOARD)))
