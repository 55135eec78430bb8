"""Whether two scenes are the same: shapes, spectra, textures, lights and matrices, to rounding."""

import dataclasses

import numpy as np

import isetcl as ic


def assert_same(a, b, where="scene"):
    """Compare all fields of two objects but their names."""
    assert type(a) is type(b), f"{where}: {a!r} against {b!r}"
    if isinstance(a, np.ndarray):
        assert a.shape == b.shape, where
        scale = np.abs(a).max(initial=0)
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * scale, err_msg=where)
    elif isinstance(a, float):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-15, err_msg=where)
    elif isinstance(a, (tuple, list)):
        assert len(a) == len(b), where
        if a and isinstance(a[0], float):
            assert_same(np.array(a), np.array(b), where)
            return
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_same(x, y, f"{where}[{i}]")
    elif isinstance(a, ic.Medium):
        grid = np.arange(400.0, 701.0, 5.0)
        np.testing.assert_allclose(a.index(grid), b.index(grid), rtol=1e-12, err_msg=where)
    elif dataclasses.is_dataclass(a):
        for field in dataclasses.fields(a):
            if field.name not in ("name", "_digest"):
                inside = f"{where}.{field.name}"
                assert_same(getattr(a, field.name), getattr(b, field.name), inside)
    else:
        assert a == b, where
