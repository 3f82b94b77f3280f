"""Winch sizing, co-design, what a limit is worth, Pareto fronts."""
