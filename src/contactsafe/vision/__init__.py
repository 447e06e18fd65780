"""From a photograph of the board to the ink mask, and from that to what a policy sees of it."""

from contactsafe.vision.log_polar import RADIUS_M, RINGS, SECTORS, ground_of, log_polar_features

__all__ = ["RADIUS_M", "RINGS", "SECTORS", "ground_of", "log_polar_features"]
