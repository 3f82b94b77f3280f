"""Robust design: families of plants, schedules, worst cases, mu."""
