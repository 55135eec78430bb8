"""The optics on the host: what an eye is, its paraxial properties, focus, field and pupils."""
