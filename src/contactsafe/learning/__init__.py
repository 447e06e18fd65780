"""From a task to a policy: vision encoder, PPO or SAC, checkpoints, and the export of a bundle.

Needs `contactsafe[train]`; nothing here imports it for you. What runs a policy is in `contactsafe.policy`, and needs
NumPy and ONNX Runtime alone.
"""
