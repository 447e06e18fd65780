"""What the policy sees of the board: ink by direction and distance from the tool, fine nearby and coarse far off.

Picture: the camera's mask, and the log-polar features of the same moment.
"""

import gymnasium
import numpy as np
from drawing import COLOUR, panels, save

import contactsafe  # noqa: F401  (makes the environment known)
from contactsafe.vision import RADIUS_M, RINGS, SECTORS, ground_of, log_polar_features


def main(folder: str = ".") -> np.ndarray:
    """Draw, and return the features of the grid, (RINGS, SECTORS)."""
    env = gymnasium.make("contactsafe/Wiping-v0")
    observation, _ = env.reset(seed=7)
    mask, tool = observation["mask"], observation["pose"][:3]
    homography = env.unwrapped.camera_homography
    features = log_polar_features(mask[None], tool[None], ground_of(homography, mask.shape[:2]))[0]
    grid = features[: RINGS * SECTORS].reshape(RINGS, SECTORS)
    print(f"ink in {np.count_nonzero(grid)} of {grid.size} cells")

    figure, (seen, polar) = panels(1, 2, (8.0, 3.8), width_ratios=(1, 1.2))
    seen.imshow(mask[..., 0], cmap="gray", vmin=-80, vmax=255, interpolation="nearest")
    u, v, w = homography @ [tool[0], tool[1], 1.0]
    seen.plot(u / w, v / w, "o", color=COLOUR["vices"], label="tool")
    seen.set(title="mask, ink black", xticks=[], yticks=[])
    seen.legend(loc="lower right", frameon=False)
    seen.spines[:].set_visible(True)

    polar.remove()
    polar = figure.add_subplot(1, 2, 2, projection="polar")
    angle = (np.arange(SECTORS + 1) - 0.5) * 2 * np.pi / SECTORS
    spacing = np.log(RADIUS_M[1] / RADIUS_M[0]) / (RINGS - 1)
    ring = np.arange(RINGS + 1)  # evenly spaced in the logarithm of distance
    polar.pcolormesh(angle, ring, grid, cmap="Greys", edgecolors="#dde2e7", linewidth=0.4)
    polar.set_theta_zero_location("S")  # world x points towards the camera, down in its image
    distances = [RADIUS_M[0] * np.exp(spacing * k) for k in (0, 4, 9)]
    polar.set_rgrids([0.5, 4.5, 9.5], [f"{100 * distance:.0f} cm" for distance in distances], color=COLOUR["safe"])
    polar.set_title("log-amount of ink about the tool")
    polar.set_xticks([])
    polar.grid(False)
    save(figure, __file__, folder)
    env.close()
    return grid


if __name__ == "__main__":
    main()
