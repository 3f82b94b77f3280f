"""Seas, vessels and operability as figures and words."""
