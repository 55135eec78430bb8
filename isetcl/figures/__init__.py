"""The figures of Lian et al. (2019), computed by isetcl, each beside the numbers of the paper."""
