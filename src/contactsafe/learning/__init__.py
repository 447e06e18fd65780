"""From masks to a policy: β-VAE, PPO or SAC, and the bundle in which a policy is shipped and run.

`bundle`, `policy`, `perception` and `evaluation` need NumPy and ONNX Runtime alone. What trains (`encoder`, `datasets`,
`train_vae`, `algorithms`, `train_policy` …) needs `contactsafe[train]`; nothing here imports it for you.
"""
