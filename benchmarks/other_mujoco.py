"""Whether the controller commands the same torques on another version of MuJoCo, and on the lowest NumPy.

    python benchmarks/other_mujoco.py 3.3.0 3.9.0     installs each version beside this one, once, and compares
    python benchmarks/other_mujoco.py --have          compares with those that are there, without the network

The same measurements are given under both: a Panda's, and those of an arm from an MJCF. The plant is left out, for
simulators may differ. Each version compiles anew, which takes some minutes.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "build" / "mujoco"
TICKS = 400
LOWEST_NUMPY = "1.26.4"  # which robosuite's mink pins
ALLOWED_NM = 1e-6  # principal axes of inertia are found to 1e-8 by the compiler of MuJoCo 3


def installed() -> list[Path]:
    """Return the folders of versions that are there."""
    return sorted(path for path in FOLDER.glob("*") if (path / "mujoco").is_dir())


def install(version: str) -> Path:
    """Put a version and the lowest NumPy into a folder of its own, beside those of this environment."""
    folder = FOLDER / version
    if not (folder / "mujoco").is_dir():
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(folder)]
        subprocess.run([*pip, f"mujoco=={version}", f"numpy=={LOWEST_NUMPY}"], check=True)
    return folder


def torques_with(folder: Path | None) -> np.ndarray:
    """Return the torques commanded in a process of its own, with the MuJoCo of a folder or this environment's."""
    paths = [*([str(folder)] if folder else []), str(ROOT / "src")]
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "torques.npy"
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        subprocess.run([sys.executable, __file__, "--into", str(path)], check=True, env=environment)
        return np.load(path)


def torques() -> np.ndarray:
    """Return the torques commanded for given measurements, (2 TICKS, 7), N m; an arm of six joints has zeros."""
    import contactsafe as cs

    rows = []
    for arm in (cs.robots.panda(), cs.robots.from_mjcf(ROOT / "examples" / "own_scene.xml", site="tip")):
        controller = cs.Controller(arm, cs.presets.safe())
        controller.reset(arm.home)
        target = cs.Target(arm.tool_pose(arm.home), stiffness=[150.0] * 3 + [450.0] * 3)
        for k in range(TICKS):
            turn = np.sin(2.0 * np.pi * k / TICKS + np.arange(arm.n))
            speed = 2.0 * np.pi / (TICKS * 0.001) * np.cos(2.0 * np.pi * k / TICKS + np.arange(arm.n))
            away = turn - np.sin(np.arange(arm.n))
            out = controller.step(cs.Measurement(arm.home + 0.01 * away, 0.01 * speed, np.zeros(6)), target)
            rows.append(np.pad(out.torque, (0, 7 - arm.n)))
    return np.array(rows)


def main() -> int:
    """Compare this environment's MuJoCo with others."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("versions", nargs="*", help="of MuJoCo, such as 3.3.0")
    parser.add_argument("--have", action="store_true", help="compare with those in build/mujoco")
    parser.add_argument("--into", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.into:
        np.save(arguments.into, torques())
        return 0
    folders = [install(version) for version in arguments.versions] + (installed() if arguments.have else [])
    here, alike = torques_with(None), True
    for folder in folders:
        difference = float(np.abs(torques_with(folder) - here).max())
        alike &= difference <= ALLOWED_NM
        print(
            f"mujoco {folder.name}: torques up to {np.abs(here).max():.1f} N m differ by {difference:.3g} N m at most"
        )
    return 0 if alike else 1


if __name__ == "__main__":
    sys.exit(main())
