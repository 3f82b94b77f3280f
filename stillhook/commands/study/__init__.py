"""Commands that study a design: sweeps, sensitivity, operability, comparison."""
