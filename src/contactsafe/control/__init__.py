"""The paper and what goes beyond it: laws, observer, supervisor, limits, and the one tick that composes them."""
