"""The calibration target on paper: a page of PDF or a PNG, true to size, with its corners named."""

import struct
import zlib
from pathlib import Path

import numpy as np

from contactsafe.core.errors import InvalidInputError
from contactsafe.core.files import write_whole
from contactsafe.vision.charuco import CharucoTarget
from contactsafe.vision.opencv import cv2

_PAPER_MM = {"A4": (297, 210), "A3": (420, 297), "A2": (594, 420), "A1": (841, 594), "A0": (1189, 841)}
_MARGIN_MM = 13.0  # for letters and marks
_MARK_MM, _LINE_MM = 7.0, 0.3  # marks that point at the outer corners
_PX_MM = 10  # of a PNG: 254 dpi
_POINTS_MM = 72.0 / 25.4


def write_sheet(target: CharucoTarget, path: Path) -> str:
    """Write a page to print without scaling, whole or not at all; return the name of its paper.

    Args:
        target: on it, in its middle.
        path: of a .pdf or .png.

    Raises:
        InvalidInputError: another kind of file, or a target that no paper holds.
        OutputError: it cannot be written.
    """
    name = _paper(target)
    kinds = {".pdf": _pdf, ".png": _png}
    if path.suffix.lower() not in kinds:
        raise InvalidInputError(f"{path.name} is no .pdf or .png; name one")
    write_whole(path, kinds[path.suffix.lower()](target, _PAPER_MM[name], _said(target, name)))
    return name


def _paper(target: CharucoTarget) -> str:
    width, height = (1000.0 * edge + 2 * _MARGIN_MM for edge in target.extent)
    for name, (long, short) in _PAPER_MM.items():
        if width <= long and height <= short:
            return name
    raise InvalidInputError(
        f"the target needs {width:.0f} × {height:.0f} mm of paper, A0 has 1189 × 841 mm; give fewer or smaller squares"
    )


def _said(target: CharucoTarget, paper: str) -> str:
    square = 1000.0 * target.square_m
    return f"contactsafe {target.columns} x {target.rows}, square {square:g} mm; print on {paper} at 100 %, measure it"


def _black(target: CharucoTarget, paper: tuple[int, int]) -> np.ndarray:
    """Return pattern and marks on the page, lower left corner and size, (k, 4), mm."""
    middle = np.array([*paper, 0.0, 0.0]) / 2.0
    marks = []
    for x, y, _ in 1000.0 * np.array(list(target.named.values())):
        right, up = float(np.sign(x)), float(np.sign(y))
        beside, beyond = x + right * (1.0 + _MARK_MM / 2), y + up * (1.0 + _MARK_MM / 2)
        marks.append((beside - _MARK_MM / 2, y - _LINE_MM / 2, _MARK_MM, _LINE_MM))
        marks.append((x - _LINE_MM / 2, beyond - _MARK_MM / 2, _LINE_MM, _MARK_MM))
    return np.concatenate([1000.0 * target.rectangles(), marks]) + middle


def _words(target: CharucoTarget, paper: tuple[int, int], said: str) -> list[tuple[float, float, str]]:
    """Return the words on the page and where they begin, mm."""
    letters = []
    for letter, (x, y, _) in target.named.items():
        aside, above = 1000.0 * x + (4.0 if x > 0 else -7.0), 1000.0 * y + (4.0 if y > 0 else -7.0)
        letters.append((aside + paper[0] / 2, above + paper[1] / 2, letter))
    return [*letters, (paper[0] / 2 - 60.0, paper[1] / 2 - 500.0 * target.extent[1] - 8.0, said)]


def _pdf(target: CharucoTarget, paper: tuple[int, int], said: str) -> bytes:
    """Compose a PDF of one page from rectangles and Helvetica (ISO 32000-1), as vectors: exact at any size."""
    rows = [" ".join(f"{value * _POINTS_MM:.4f}" for value in row) + " re" for row in _black(target, paper)]
    words = [
        f"BT /F1 {11 if len(text) == 1 else 9} Tf {x * _POINTS_MM:.2f} {y * _POINTS_MM:.2f} Td ({text}) Tj ET"
        for x, y, text in _words(target, paper, said)
    ]
    drawn = zlib.compress("\n".join([*rows, "f", *words]).encode("ascii"))
    box = " ".join(f"{edge * _POINTS_MM:.4f}" for edge in paper)
    parts = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        b"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 %b] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>"
        % box.encode(),
        b"<< /Length %d /Filter /FlateDecode >>\nstream\n%b\nendstream" % (len(drawn), drawn),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    data, places = b"%PDF-1.4\n", []
    for number, part in enumerate(parts, 1):
        places.append(len(data))
        data += b"%d 0 obj\n%b\nendobj\n" % (number, part)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    size = len(parts) + 1
    end = b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (size, len(data))
    return data + b"xref\n0 %d\n0000000000 65535 f \n" % size + table + end


def _png(target: CharucoTarget, paper: tuple[int, int], said: str) -> bytes:
    """Paint the page at ten pixels a millimetre, and say so in it, so that it prints true to size."""
    page = np.full((paper[1] * _PX_MM, paper[0] * _PX_MM), 255, np.uint8)
    for left, lower, width, height in _black(target, paper):
        columns, rows = (
            slice(*np.rint(np.array(ends) * _PX_MM).astype(int))
            for ends in ((left, left + width), (paper[1] - lower - height, paper[1] - lower))
        )
        page[rows, columns] = 0
    for x, y, text in _words(target, paper, said):
        place = (round(x * _PX_MM), round((paper[1] - y) * _PX_MM))
        cv2.putText(page, text, place, cv2.FONT_HERSHEY_SIMPLEX, 1.5 if len(text) == 1 else 0.9, 0, 2, cv2.LINE_AA)
    data = cv2.imencode(".png", page)[1].tobytes()
    begins = 8 + 4 + 4 + 13 + 4  # behind the header
    size = b"pHYs" + struct.pack(">IIB", 1000 * _PX_MM, 1000 * _PX_MM, 1)
    return data[:begins] + struct.pack(">I", 9) + size + struct.pack(">I", zlib.crc32(size)) + data[begins:]
