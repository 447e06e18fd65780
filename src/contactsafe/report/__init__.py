"""Data in, pages out: a table for the terminal, `summary.json`, and `report.html`, which needs nothing but itself."""

from contactsafe.report.data import COLOURS
from contactsafe.report.output import prepare_output
from contactsafe.report.page import write_report
from contactsafe.report.scene import View, visible_faces
from contactsafe.report.summary import write_summary
from contactsafe.report.terminal import terminal_table

__all__ = ["COLOURS", "View", "prepare_output", "terminal_table", "visible_faces", "write_report", "write_summary"]
