"""What PSF methods get wrong where one object hides another."""
