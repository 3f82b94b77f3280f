"""Designs as files, figures and reports."""
