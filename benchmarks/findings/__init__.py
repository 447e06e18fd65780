"""What the paper leaves open, measured: one short function for each finding of docs/concepts/open.md.

`python -m benchmarks.findings` runs all of them, `python -m benchmarks.findings 3 12` two of them. Nothing is typed in
but scenes and settings: every figure printed is measured when the program runs, on few trials, so that each finding
takes well under a minute. The first run compiles for a minute or two.
"""
