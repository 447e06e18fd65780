"""Between a policy and a controller: observations, actions, the bundle, and how it acts. No torch, no simulator."""

from contactsafe.policy.action_config import ActionConfig
from contactsafe.policy.bundle import Bundle, shipped_bundle
from contactsafe.policy.observation import Observation
from contactsafe.policy.policy import Policy

__all__ = ["ActionConfig", "Bundle", "Observation", "Policy", "shipped_bundle"]
