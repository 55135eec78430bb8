"""OpenCL C: entry points here, the functions they are built from in lib/."""
