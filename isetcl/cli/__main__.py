"""`python -m isetcl.cli` is the command `isetcl`."""

from isetcl.cli import main

main()
