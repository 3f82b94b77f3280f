"""Controller structures: parameters to C(s)."""
