"""Version of isetcl."""

__version__ = "0.1.0"
