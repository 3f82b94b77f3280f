"""Limits of a design: margins, signals, and what a case asks for."""
