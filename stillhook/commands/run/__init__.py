"""Commands about runs in time."""
