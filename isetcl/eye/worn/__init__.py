"""Lenses worn in front of an eye or in it, as changes of an eye."""
