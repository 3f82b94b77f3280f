"""Model predictive controllers: reserved, nothing here yet.

The package holds its place in the layout because the import contract names it: `mpc` will
stand beside `synth`, build on `models` alone, and be reached through `stillhook`.
"""
