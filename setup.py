"""Package metadata of isetcl; tool settings are in pyproject.toml."""

from pathlib import Path

from setuptools import find_packages, setup

here = Path(__file__).parent
namespace: dict[str, str] = {}
exec((here / "isetcl" / "version.py").read_text(encoding="utf-8"), namespace)

setup(
    name="isetcl",
    version=namespace["__version__"],
    description="OpenCL-accelerated retinal images: spectral ray tracing through model eyes, "
    "and how far PSF convolution is from it",
    long_description=(here / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    author="The isetcl developers",
    license="BSD-3-Clause",
    license_files=["LICENSE"],
    python_requires=">=3.10",
    packages=find_packages(include=["isetcl", "isetcl.*"]),
    package_data={
        "isetcl": ["py.typed"],
        "isetcl.kernels": ["*.cl", "lib/*.cl", "lib/*/*.cl"],
        "isetcl.data": ["*.csv"],
    },
    install_requires=[
        "pyopencl>=2024.1",
        'pocl-binary-distribution>=3.0; sys_platform == "linux" and platform_machine == "x86_64"',
        "numpy>=1.24",
        "scipy>=1.10",
        "xarray>=2023.1",
        "h5netcdf>=1.1",
        "h5py>=3.8",
        "trimesh>=4.0",
        "scikit-image>=0.21",
        "colour-science>=0.4.4",
        "matplotlib>=3.7",
        "pillow>=9.4",
        "platformdirs>=3.0",
        "typer>=0.12",
        "rich>=13.0",
    ],
    extras_require={
        "test": [
            "pytest>=7.4",
            "pytest-xdist>=3.3",
            "hypothesis>=6.80",
            "mpmath>=1.3",
            "ruff>=0.6",
            "mypy>=1.8",
            "psutil>=5.9",
        ],
        "gpu-fft": ["pyvkfft>=2024.1"],
        # The program ffmpeg with its H.264 encoder, in a wheel of 20 to 68 MB.
        "movies": ["imageio-ffmpeg>=0.5.1"],
        "peers": ["batoid>=0.8", "mitsuba>=3.5", "embreex>=2.17", "optiland>=0.6"],
    },
    entry_points={"console_scripts": ["isetcl = isetcl.cli:main"]},
    classifiers=[
        "Programming Language :: Python :: 3",
        "Topic :: Scientific/Engineering :: Physics",
    ],
)
