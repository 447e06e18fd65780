"""From a photograph of the board to its mask, the same in simulation and on a robot. Needs `contactsafe[camera]`."""

from contactsafe.core.errors import InvalidInputError

try:
    import cv2 as cv2
except ImportError as error:
    raise InvalidInputError("photographs need OpenCV; run: pip install 'contactsafe[camera]'") from error
