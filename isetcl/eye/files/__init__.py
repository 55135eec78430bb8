"""Eyes in files: isetcl's own JSON, Zemax prescriptions, ISET3d lens files."""
