"""Wiping the ink off a whiteboard."""
