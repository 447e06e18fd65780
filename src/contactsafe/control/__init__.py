"""The contact pipeline and the one tick that composes it.

    measurement → observer → detection → isolation → identification → classification → reaction → limits → torque

One stage a file: its record of state, then its laws. A function of a stage takes the record that it advances first;
what follows it only reads. `config` declares the parameters, `presets` has the controllers by name, `tick` puts the
stages together, `controller` is for callers.
"""
