"""From a photograph of the board to the ink mask, and from that to what a policy sees of it."""
