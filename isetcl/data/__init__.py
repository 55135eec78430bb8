"""Tables that isetcl ships, each with its source in its first line."""
