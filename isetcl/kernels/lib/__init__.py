"""OpenCL C functions, one noun a file."""
