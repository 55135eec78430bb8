"""Refracting surfaces beyond conics of revolution, in the frame of their vertex."""
