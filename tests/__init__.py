"""A package by declaration: Hershey-Fonts installs a `tests` of its own, which would win over a mere folder."""
