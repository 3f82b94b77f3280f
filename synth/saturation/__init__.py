"""Limit cycles of a saturated loop, by describing functions."""
