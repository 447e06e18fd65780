"""Putting a round peg into a hole whose place is known only roughly."""
