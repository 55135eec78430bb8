"""Pictures of floating-point numbers (PFM, Radiance HDR, plain OpenEXR), and maps of the sphere."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path

import numpy as np

from isetcl.errors import FileError, IsetclError
from isetcl.memory import check_memory
from isetcl.scene.pbrt.files import read_bytes
from isetcl.scene.texture import load_image

FLOAT_SUFFIXES = (".pfm", ".hdr", ".pic", ".exr")

_MOST_TEXELS = 1 << 30


def read_picture(path: Path, encoding: str | None = None) -> np.ndarray:
    """A picture in linear light, (rows, columns) or (rows, columns, 3), row 0 at the top.

    Parameters
    ----------
    path
        PFM, HDR (Radiance), EXR (uncompressed, RLE or ZIP, by scan lines), or what `load_image`
        reads.
    encoding
        How integers are encoded: "sRGB" (also None), "linear", or "gamma 2.2".

    Raises
    ------
    FileError
        If it cannot be read.
    """
    if path.suffix.lower() not in FLOAT_SUFFIXES:
        texels = np.asarray(load_image(path).texels, dtype=np.float32)
        return _encoded(texels, encoding, path)
    texels = read_floats(path)
    return np.nan_to_num(np.maximum(texels, 0.0), nan=0.0, posinf=3e38).astype(np.float32)


def read_floats(path: Path) -> np.ndarray:
    """The numbers of a PFM, HDR or EXR file as they are, row 0 at the top.

    Returns
    -------
    ndarray, (rows, columns) or (rows, columns, 3)

    Raises
    ------
    FileError
        If it cannot be read.
    """
    suffix = path.suffix.lower()
    readers = {".pfm": _read_pfm, ".hdr": _read_hdr, ".pic": _read_hdr, ".exr": _read_exr}
    data = read_bytes(path, "picture", factor=6.0)
    try:
        return readers[suffix](data)
    except IsetclError as error:
        raise FileError(f"picture {str(path)!r}: {error}") from error
    except (ValueError, IndexError, struct.error, zlib.error, KeyError, OverflowError) as error:
        raise FileError(
            f"picture {str(path)!r} cannot be read as {suffix[1:].upper()} ({error}); save it "
            "again as PFM or PNG"
        ) from error


def _encoded(texels: np.ndarray, encoding: str | None, path: Path) -> np.ndarray:
    """Undo sRGB decoding where integers were encoded otherwise."""
    name = (encoding or "sRGB").split()
    if name[0] == "sRGB" or path.suffix.lower() in (".tif", ".tiff"):
        return texels
    code = np.where(
        texels <= 0.0031308, texels * 12.92, 1.055 * np.maximum(texels, 0) ** (1 / 2.4) - 0.055
    )
    power = float(name[1]) if name[0] == "gamma" and len(name) == 2 and _is_real(name[1]) else 1.0
    return np.asarray(np.clip(code, 0.0, 1.0) ** power, dtype=np.float32)


def _is_real(word: str) -> bool:
    return bool(re.fullmatch(r"\d{0,3}\.?\d{0,6}", word)) and word.strip(".") != ""


def _size(columns: int, rows: int, channels: int = 3) -> None:
    if not (0 < columns <= _MOST_TEXELS and 0 < rows <= _MOST_TEXELS):
        raise FileError(f"the size must be positive, got {columns} by {rows}")
    check_memory(
        f"a picture of {columns} by {rows}",
        16.0 * columns * rows * channels,
        lambda shrink: f"shrink it to {int(columns * shrink)} columns",
    )


def _read_pfm(data: bytes) -> np.ndarray:
    """Portable float map. Source: Debevec's PFM description (pauldebevec.com/Research/HDR/PFM)."""
    head = re.match(rb"(P[Ff])\s+(\d{1,9})\s+(\d{1,9})\s+([-+0-9.eE]+)\s", data)
    if not head:
        raise FileError("no PFM header (PF or Pf, columns, rows, scale)")
    channels = 3 if head.group(1) == b"PF" else 1
    columns, rows = int(head.group(2)), int(head.group(3))
    _size(columns, rows, channels)
    scale = float(head.group(4))
    body = data[head.end() : head.end() + 4 * columns * rows * channels]
    if len(body) != 4 * columns * rows * channels or scale == 0:
        raise FileError("the PFM is shorter than its header says")
    texels = np.frombuffer(body, dtype="<f4" if scale < 0 else ">f4").astype(np.float32)
    shape = (rows, columns, 3) if channels == 3 else (rows, columns)
    flipped: np.ndarray = texels.reshape(shape)[::-1]
    return flipped


def write_pfm(path: Path, texels: np.ndarray) -> None:
    """Write grey or coloured texels, row 0 at the top, as they are."""
    data = np.ascontiguousarray(np.asarray(texels)[::-1].astype("<f4"))
    kind = "PF" if data.ndim == 3 else "Pf"
    header = f"{kind}\n{data.shape[1]} {data.shape[0]}\n-1.0\n".encode()
    path.write_bytes(header + data.tobytes())


def _read_hdr(data: bytes) -> np.ndarray:
    """Radiance RGBE. Source: Ward 1991, Real pixels, Graphics Gems II; Radiance file formats."""
    head = re.search(rb"\n\n-Y (\d{1,9}) \+X (\d{1,9})\n", data[:65536])
    if not data.startswith(b"#?") or not head:
        raise FileError("no Radiance header with -Y rows +X columns")
    rows, columns = int(head.group(1)), int(head.group(2))
    _size(columns, rows)
    source = np.frombuffer(data, dtype=np.uint8, offset=head.end())
    texels = np.empty((rows, columns, 4), dtype=np.uint8)
    place = 0
    for row in range(rows):
        packed = (
            8 <= columns < 32768
            and tuple(source[place : place + 2]) == (2, 2)
            and source[place + 2] < 128
        )
        if not packed:
            flat = source[place : place + 4 * columns]
            texels[row] = flat.reshape(columns, 4)
            place += 4 * columns
            continue
        place += 4
        for channel in range(4):
            place = _unpack_run(source, place, texels[row, :, channel])
    exponent = texels[..., 3:].astype(np.int32)
    colour = np.ldexp(texels[..., :3].astype(np.float32), exponent - 136)
    return np.where(exponent > 0, colour, 0.0).astype(np.float32)


def _unpack_run(source: np.ndarray, place: int, line: np.ndarray) -> int:
    """Fill a line from run lengths; returns where the next begins."""
    column = 0
    while column < len(line):
        count = int(source[place])
        if count > 128:
            count -= 128
            line[column : column + count] = source[place + 1]
            place += 2
        else:
            if count == 0:
                raise FileError("a run of length 0")
            line[column : column + count] = source[place + 1 : place + 1 + count]
            place += 1 + count
        column += count
    if column != len(line):
        raise FileError("a run beyond the end of its line")
    return place


def _read_exr(data: bytes) -> np.ndarray:
    """OpenEXR by scan lines, compression none, RLE, ZIPS or ZIP; channels R G B, or Y.

    Source: the OpenEXR file layout page of openexr.com.
    """
    if data[:4] != b"\x76\x2f\x31\x01":
        raise FileError("no OpenEXR file")
    (version,) = struct.unpack_from("<I", data, 4)
    if version & 0x1A00:
        raise FileError("tiled, deep and multi-part OpenEXR are not read; save it by scan lines")
    attributes, place = _exr_header(data)
    compression = attributes["compression"][0]
    if compression > 3:
        raise FileError("this compression is not read; save it again with ZIP or none, or as PFM")
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    columns, rows = x1 - x0 + 1, y1 - y0 + 1
    channels = _exr_channels(attributes["channels"])
    _size(columns, rows, len(channels))
    lines = {0: 1, 1: 1, 2: 1, 3: 16}[compression]
    blocks = -(-rows // lines)
    offsets = struct.unpack_from(f"<{blocks}Q", data, place)
    planes = {name: np.zeros((rows, columns), dtype=np.float32) for name, _ in channels}
    for offset in offsets:
        y, size = struct.unpack_from("<ii", data, offset)
        count = min(lines, y1 - y + 1)
        if not 0 <= y - y0 < rows or size < 0:
            raise FileError("a block lies outside the picture")
        body = data[offset + 8 : offset + 8 + size]
        wanted = count * columns * sum(4 if kind else 2 for _, kind in channels)
        raw = body if len(body) == wanted else _exr_unpacked(body, compression, wanted)
        _exr_block(raw, channels, planes, y - y0, count)
    if {"R", "G", "B"} <= planes.keys():
        return np.stack([planes["R"], planes["G"], planes["B"]], axis=-1)
    return next(iter(planes.values())) if "Y" not in planes else planes["Y"]


def _exr_header(data: bytes) -> tuple[dict[str, bytes], int]:
    attributes: dict[str, bytes] = {}
    place = 8
    while data[place] != 0:
        name_end = data.index(b"\0", place)
        kind_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, kind_end + 1)
        if size < 0:
            raise FileError("an attribute of negative size")
        start = kind_end + 5
        attributes[data[place:name_end].decode("latin-1")] = data[start : start + size]
        place = start + size
    return attributes, place + 1


def _exr_channels(packed: bytes) -> list[tuple[str, bool]]:
    """Names of the channels in their order, and whether they are 32 bits wide."""
    channels = []
    place = 0
    while packed[place] != 0:
        end = packed.index(b"\0", place)
        kind, _, step_x, step_y = struct.unpack_from("<iIii", packed, end + 1)
        if kind not in (1, 2) or (step_x, step_y) != (1, 1):
            raise FileError("channels of integers, or subsampled ones, are not read")
        channels.append((packed[place:end].decode("latin-1"), kind == 2))
        place = end + 17
    if not channels:
        raise FileError("it has no channels")
    return channels


def _exr_unpacked(body: bytes, compression: int, wanted: int) -> bytes:
    if compression == 0:
        raise FileError("a block is shorter than it should be")
    if compression == 1:
        raw = _exr_runs(body, wanted)
    else:
        raw = zlib.decompressobj().decompress(body, wanted)
    if len(raw) != wanted:
        raise FileError("a block is shorter than it should be")
    deltas = np.frombuffer(raw, dtype=np.uint8).astype(np.int64)
    deltas[1:] -= 128
    values = np.cumsum(deltas).astype(np.uint8)
    half = (wanted + 1) // 2
    merged = np.empty(wanted, dtype=np.uint8)
    merged[0::2], merged[1::2] = values[:half], values[half:]
    return merged.tobytes()


def _exr_runs(body: bytes, wanted: int) -> bytes:
    out = bytearray()
    place = 0
    while place < len(body) and len(out) <= wanted:
        count = struct.unpack_from("<b", body, place)[0]
        if count < 0:
            out += body[place + 1 : place + 1 - count]
            place += 1 - count
        else:
            out += body[place + 1 : place + 2] * (count + 1)
            place += 2
    return bytes(out)


def _exr_block(
    raw: bytes,
    channels: list[tuple[str, bool]],
    planes: dict[str, np.ndarray],
    first: int,
    count: int,
) -> None:
    """Put the lines of a block into the planes: line by line, channel by channel."""
    columns = next(iter(planes.values())).shape[1]
    place = 0
    for row in range(first, first + count):
        for name, is_wide in channels:
            kind, size = ("<f4", 4) if is_wide else ("<f2", 2)
            planes[name][row] = np.frombuffer(raw, dtype=kind, count=columns, offset=place)
            place += size * columns


def octahedral_coordinates(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (u, v) in a square, from its top left, of directions (..., 3): equal areas.

    Source: Clarberg 2008, Fast equal-area mapping of the (hemi)sphere using SIMD (Journal of
    Graphics Tools 13:53); PBRT 4 uses it for its environment images.
    """
    x, y, z = (np.abs(directions[..., i]) for i in range(3))
    radius = np.sqrt(np.maximum(0.0, 1.0 - z))
    turn = np.arctan2(y, x) * (2.0 / np.pi)
    v = turn * radius
    u = radius - v
    lower = directions[..., 2] < 0
    u, v = np.where(lower, 1.0 - v, u), np.where(lower, 1.0 - u, v)
    u, v = np.copysign(u, directions[..., 0]), np.copysign(v, directions[..., 1])
    return (u + 1.0) / 2.0, (v + 1.0) / 2.0


def octahedral_directions(n: int) -> np.ndarray:
    """Unit directions (n, n, 3) of the centres of an equal-area square's texels, row by row."""
    centres = 2.0 * (np.arange(n) + 0.5) / n - 1.0
    u, v = np.meshgrid(centres, centres)
    a, b = np.abs(u), np.abs(v)
    signed = 1.0 - (a + b)
    radius = 1.0 - np.abs(signed)
    safe = np.where(radius > 0, radius, 1.0)
    turn = np.where(radius > 0, (b - a) / safe + 1.0, 1.0) * (np.pi / 4.0)
    z = np.copysign(1.0 - radius**2, signed)
    across = radius * np.sqrt(np.maximum(0.0, 2.0 - radius**2))
    return np.stack(
        [np.copysign(np.cos(turn), u) * across, np.copysign(np.sin(turn), v) * across, z], axis=-1
    )


def latitude_longitude(square: np.ndarray) -> np.ndarray:
    """An equal-area octahedral square, resampled to longitude by latitude about its +z.

    Column 0 begins at +x and turns to +y; row 0 is at +z. Twice as wide as high, as fine along the
    equator as the square.
    """
    n = square.shape[0]
    rows = max(2, int(np.ceil(n * np.sqrt(np.pi / 2.0) / 2.0)) * 2)
    columns = 2 * rows
    theta = (np.arange(rows) + 0.5) / rows * np.pi
    phi = (np.arange(columns) + 0.5) / columns * 2.0 * np.pi
    sine = np.sin(theta)[:, None]
    directions = np.stack(
        np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[:, None]),
        axis=-1,
    )
    u, v = octahedral_coordinates(directions)
    x = np.clip((u * n - 0.5), 0, n - 1)
    y = np.clip((v * n - 0.5), 0, n - 1)
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    right, low = np.minimum(left + 1, n - 1), np.minimum(top + 1, n - 1)
    fx, fy = (x - left), (y - top)
    if square.ndim == 3:
        fx, fy = fx[..., None], fy[..., None]
    upper = square[top, left] * (1 - fx) + square[top, right] * fx
    lower = square[low, left] * (1 - fx) + square[low, right] * fx
    return np.asarray(upper * (1 - fy) + lower * fy, dtype=np.float32)
