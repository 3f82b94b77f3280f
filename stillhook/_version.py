"""The version, in a file of its own: whoever tells it needs nothing else of the face."""

__version__ = "0.1.0"
