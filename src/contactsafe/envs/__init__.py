"""Gymnasium environments: the wiping task, single and vector, its actions and rewards."""

import gymnasium

WIPING = "contactsafe/Wiping-v0"


def register() -> None:
    """Make `contactsafe/Wiping-v0` known to Gymnasium; importing contactsafe does this."""
    if WIPING not in gymnasium.registry:
        gymnasium.register(
            WIPING,
            entry_point="contactsafe.envs.wiping:WipingEnv",
            vector_entry_point="contactsafe.envs.wiping:WipingVectorEnv",
        )
