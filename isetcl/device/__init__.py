"""Everything that touches OpenCL from Python: devices, struct layout, programs, the ray tracer."""
