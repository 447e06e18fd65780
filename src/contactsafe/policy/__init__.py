"""Between a policy and a controller: observations, actions, the bundle, and how it acts. No torch, no simulator."""
