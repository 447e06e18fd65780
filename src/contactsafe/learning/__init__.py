"""From masks to a policy: β-VAE, PPO, and the bundle in which a policy is shipped and run.

`bundle`, `policy`, `perception` and `evaluation` need NumPy and ONNX Runtime alone. What trains (`encoder`, `datasets`,
`train_vae`, `vec_env`, `train_ppo`, `export`, `probe`) needs `contactsafe[train]`; nothing here imports it for you.
"""
