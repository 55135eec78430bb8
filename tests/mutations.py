"""Deliberate faults, each of which some test must catch: `python tests/mutations.py [names]`.

Every mutation is a textual change to a temporary copy of the package; the smallest set of tests
that must notice it runs against the copy. Exit status 1 if a mutation survives, 2 if a text to
change is not found once or the tests fail without any change.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
FAILED_TESTS = 1  # pytest's exit status


@dataclass(frozen=True)
class Edit:
    """A text in a file of the package, which must be there once, and what takes its place."""

    file: str
    old: str
    new: str

    def apply(self, root: Path) -> None:
        path = root / "isetcl" / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise LookupError(
                f"isetcl/{self.file} must have this text once, has it {text.count(self.old)} "
                f"times:\n{self.old}"
            )
        path.write_text(text.replace(self.old, self.new), encoding="utf-8")


@dataclass(frozen=True)
class Mutation:
    """Edits, what goes wrong by them, and the tests that must fail."""

    name: str
    fault: str
    edits: tuple[Edit, ...]
    tests: tuple[str, ...]


def cases(*numbers: int, precisions: tuple[str, ...] = ("single", "double")) -> tuple[str, ...]:
    """Tests of stability cases by number."""
    return tuple(
        f"tests/test_stability.py::test_the_case_passes[{p}-{n}]"
        for n in numbers
        for p in precisions
    )


MUTATIONS = (
    Mutation(
        "sign of N",
        "the root is chosen by the sign of the direction's z instead of the sense of travel",
        (
            Edit(
                "kernels/lib/ray.cl",
                "INLINE realv crossing_root(realv f, realv g, realv a, real sense,",
                "INLINE realv crossing_root(realv f, realv g, realv a, realv sense,",
            ),
            Edit(
                "kernels/lib/conic.cl",
                "crossing_root(f, g, a, sense, far_side, &at->q, &near_side)",
                "crossing_root(f, g, a, ray->tz < 0 ? (realv)-1 : (realv)1, far_side, &at->q, "
                "&near_side)",
            ),
        ),
        cases(18),
    ),
    Mutation(
        "vertex plane",
        "rays go to the plane of the vertex first, not to their closest approach to it",
        (
            Edit(
                "kernels/lib/ray.cl",
                "-s->inverse_n2 * mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, "
                "ray->z * ray->tz));",
                "-ray->z / ray->tz;",
            ),
        ),
        cases(18),
    ),
    Mutation(
        "no fma",
        "products and sums are rounded one by one",
        (
            Edit(
                "kernels/lib/real.cl",
                "#define mul_add(a, b, c) ((a) * (b) + (c))\n",
                "#pragma OPENCL FP_CONTRACT OFF\n#define mul_add(a, b, c) ((a) * (b) + (c))\n",
            ),
        ),
        ("tests/test_device.py::test_the_device_passes_its_self_test",),
    ),
    Mutation(
        "no 1 + 2 gamma(3)",
        "boxes are left where rounding says",
        (
            Edit(
                "kernels/lib/bvh.cl",
                "(far_xy < far_z ? far_xy : far_z) * (1 + ROUNDING);",
                "(far_xy < far_z ? far_xy : far_z);",
            ),
        ),
        cases(47, 49, 50),
    ),
    Mutation(
        "no slack of slabs",
        "rounding of the origin over the direction is not allowed for",
        (Edit("kernels/lib/bvh.cl", "(at < 0 ? -at : at) * ROUNDING + ", ""),),
        cases(47),
    ),
    Mutation(
        "plain Woop",
        "sides of edges are differences of products without Kahan's correction",
        (Edit("kernels/lib/bvh.cl", "  return difference + error;", "  return difference;"),),
        cases(47),
    ),
    Mutation(
        "spheres too small",
        "what rounding leaves along a ray counts as distance from the middle of a sphere",
        (
            Edit(
                "kernels/lib/shapes.cl",
                "mul_add(-left, left, dot3(px, py, pz, px, py, pz))",
                "dot3(px, py, pz, px, py, pz)",
            ),
        ),
        cases(48, precisions=("single",)),
    ),
    Mutation(
        "float32 accumulator",
        "replicates are added up in single precision",
        (
            Edit(
                "render/accumulate.py",
                "            self._sum = film * samples\n",
                "            self._sum = np.float32(film * samples)\n",
            ),
            Edit(
                "render/accumulate.py",
                "            self._sum += film * samples\n",
                "            self._sum += np.float32(film * samples)\n",
            ),
        ),
        cases(54),
    ),
    Mutation(
        "float32 launches",
        "the launches of a replicate are added up in single precision",
        (
            Edit(
                "render/direct.py",
                "        film = np.zeros((self._channels, tile.rows, tile.columns))\n",
                "        film = np.zeros((self._channels, tile.rows, tile.columns), np.float32)\n",
            ),
        ),
        ("tests/test_direct.py::test_a_long_sum_is_continued_in_float64",),
    ),
    Mutation(
        "endless launches",
        "a kernel adds up all samples of a pixel in its own precision",
        (Edit("render/direct.py", "SAMPLES_PER_LAUNCH = 256", "SAMPLES_PER_LAUNCH = 1 << 24"),),
        cases(54, precisions=("single",)),
    ),
    Mutation(
        "one Newton step fewer, single",
        "biconics are searched in 3 steps",
        (
            Edit(
                "device/elements.py",
                "        ShapeKind.BICONIC: 4,",
                "        ShapeKind.BICONIC: 3,",
            ),
        ),
        cases(32, precisions=("single",)),
    ),
    Mutation(
        "one Newton step fewer, double",
        "biconics are searched in 5 steps",
        (
            Edit(
                "device/elements.py",
                "        ShapeKind.BICONIC: 6,",
                "        ShapeKind.BICONIC: 5,",
            ),
        ),
        cases(32, precisions=("double",)),
    ),
    Mutation(
        "one landing round fewer",
        "rays through a gradient land after one round less",
        (
            Edit(
                "device/elements.py",
                "= landing_rounds(inside, precision)",
                "= max(0, landing_rounds(inside, precision) - 1)",
            ),
        ),
        cases(40, 42, 45),
    ),
    Mutation(
        "equator not split off",
        "the front half of a gradient lens reaches to its back surface",
        (
            Edit(
                "eye/models/liou_brennan.py",
                "    return front, middle, back\n",
                "    return front, back\n",
            ),
        ),
        (
            *cases(44, precisions=("double",)),
            "tests/test_gradient_eyes.py::"
            "test_liou_and_brennan_s_eye_has_its_published_power_and_length",
        ),
    ),
    Mutation(
        "native square root",
        "roots are as exact as the hardware likes",
        (
            Edit(
                "kernels/lib/real.cl",
                "INLINE realv square_root(realv x) { return sqrt(x); }",
                "INLINE realv square_root(realv x) { return native_sqrt(x); }",
            ),
        ),
        (
            "tests/test_architecture.py::"
            "test_kernels_never_call_what_stops_vectorisation_or_loses_precision",
        ),
    ),
    Mutation(
        "photopic cones",
        "illuminance counts as a fourth type of cone in a goal of cone noise",
        (
            Edit(
                "render/film.py",
                "self._known(slice(self._photopic + 1, None))",
                "self._known(slice(self._photopic, None))",
            ),
        ),
        ("tests/test_cone_noise.py::test_the_goal_counts_cones_only_however_short_the_time",),
    ),
    Mutation(
        "light beside apertures",
        "rounding lets receptors see pixels that their aperture does not reach",
        (
            Edit(
                "kernels/cone_excitations.cl",
                "          share = share > least ? share : (realv)0;\n",
                "",
            ),
        ),
        ("tests/test_excitations.py::test_light_beside_an_aperture_does_not_reach_it",),
    ),
    Mutation(
        "shares one by one",
        "the parts of an aperture of thousands of pixels are added up one by one",
        (
            Edit(
                "kernels/cone_excitations.cl",
                "          row_shares += share;\n",
                "          shares += share;\n",
            ),
        ),
        ("tests/test_excitations.py::test_apertures_of_many_pixels_are_summed_in_strips",),
    ),
    Mutation(
        "fast relaxed math",
        "kernels are built with -cl-fast-relaxed-math",
        (
            Edit(
                "device/devices.py",
                'options = ["-cl-std=CL1.2"]',
                'options = ["-cl-std=CL1.2", "-cl-fast-relaxed-math"]',
            ),
        ),
        cases(8, 10, 11),
    ),
    Mutation(
        "tails of an edge left out",
        "light that an edge spreads beyond the region is found, and not put back",
        (
            Edit(
                "validation/transfer/spread.py",
                "slopes += np.outer(tail.beyond(",
                "slopes += 0.0 * np.outer(tail.beyond(",
            ),
        ),
        (
            "tests/test_slanted_edge.py::"
            "test_the_transfer_of_a_known_edge_is_found[diffraction-0.5-9.46]",
        ),
    ),
    Mutation(
        "light along an edge believed",
        "brightness that changes along an edge counts as a turn of its line",
        (
            Edit(
                "validation/transfer/spread.py",
                "design = np.concatenate([turns, found.gradients(values)], axis=1)",
                "design = turns",
            ),
        ),
        (
            "tests/test_slanted_edge.py::"
            "test_light_that_falls_off_along_the_edge_does_not_turn_it[7.0]",
        ),
    ),
    Mutation(
        "cone noise of the mean",
        "errors are told in units of the noise of a cone in the mean light, wherever they are",
        (
            Edit(
                "validation/work_precision/cone_units.py",
                "(level * reference[lit])",
                "(level * level)",
            ),
        ),
        ("tests/test_work_precision_cones.py::test_noise_is_told_in_units_of_cone_noise",),
    ),
    Mutation(
        "narrow intervals",
        "intervals of errors are a fifth too narrow",
        (
            Edit(
                "validation/work_precision/estimators.py",
                "wide = math.sqrt(count / (count - 1)) * float(t.ppf(share, count - 1))",
                "wide = 0.8 * math.sqrt(count / (count - 1)) * float(t.ppf(share, count - 1))",
            ),
        ),
        (
            "tests/test_work_precision_intervals.py::"
            "test_intervals_hold_the_truth_95_times_in_100[0.0--0.5-0.1]",
        ),
    ),
    Mutation(
        "periphery as the parafovea",
        "lattices are no more disordered where cones are far apart",
        (
            Edit(
                "cones/disorder.py",
                "    return np.maximum(np.interp(six_sided, *_DISORDER_OF_SHARE), near)\n",
                "    return np.interp(six_sided, *_DISORDER_OF_SHARE) + 0.0 * near\n",
            ),
        ),
        (
            "tests/test_cone_lattice.py::"
            "test_peripheral_cones_keep_six_to_eight_micrometres_apart_however_few_they_are",
        ),
    ),
    Mutation(
        "cones on top of each other",
        "peripheral cones come nearer than inner segments that touch",
        (Edit("cones/disorder.py", "_TOUCHING_UM = 6.5", "_TOUCHING_UM = 0.5"),),
        ("tests/test_cone_lattice.py::test_no_two_peripheral_cones_are_nearer_than_they_can_be",),
    ),
    Mutation(
        "rods of the other eye",
        "the nasal rods of every eye are those of a left one",
        (Edit("cones/field.py", "wanted_rods(rods, self.eye,", 'wanted_rods(rods, "left",'),),
        ("tests/test_rods.py::test_a_field_has_the_rods_of_its_own_eye",),
    ),
    Mutation(
        "rods inside cones",
        "rods that were pushed into cones are left out",
        (Edit("cones/rods.py", "_BEYOND_RIM = 1.05", "_BEYOND_RIM = 0.0"),),
        ("tests/test_rods.py::test_rods_are_as_many_as_wanted_and_stand_clear_of_the_cones",),
    ),
)


def copied(into: Path) -> Path:
    """A copy of the package and its tests."""
    for folder in ("isetcl", "tests"):
        shutil.copytree(ROOT / folder, into / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", into)
    return into


def run_tests(root: Path, tests: tuple[str, ...]) -> tuple[int, str]:
    """pytest's exit status and output for tests of a copy."""
    environment = os.environ | {
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        # What the copy finds out about devices must not be believed later.
        "XDG_CACHE_HOME": str(root / "cache"),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-m", "", "-x", *tests]
    done = subprocess.run(
        [*command, "-p", "no:cacheprovider"],
        cwd=root,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def attempt(mutation: Mutation) -> tuple[str, str]:
    """``"caught"``, ``"survived"`` or ``"broken"``, and the line of pytest that says so."""
    with tempfile.TemporaryDirectory(prefix="isetcl-mutation-") as folder:
        root = copied(Path(folder))
        for edit in mutation.edits:
            edit.apply(root)
        status, output = run_tests(root, mutation.tests)
    lines = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR", "E   "))]
    last = lines[-1] if lines else output.strip().splitlines()[-1]
    return {0: "survived", FAILED_TESTS: "caught"}.get(status, "broken"), last


def main(names: list[str]) -> int:
    chosen = [m for m in MUTATIONS if not names or m.name in names]
    unknown = set(names) - {m.name for m in MUTATIONS}
    if unknown:
        print(f"no mutation {sorted(unknown)[0]!r}; there are {[m.name for m in MUTATIONS]}")
        return 2
    with tempfile.TemporaryDirectory(prefix="isetcl-unchanged-") as folder:
        tests = tuple(dict.fromkeys(t for m in chosen for t in m.tests))
        status, output = run_tests(copied(Path(folder)), tests)
        if status != 0:
            print(f"the tests do not pass without a mutation:\n{output}")
            return 2
    outcomes = []
    for mutation in chosen:
        start = time.perf_counter()
        verdict, line = attempt(mutation)
        outcomes.append(verdict)
        seconds = time.perf_counter() - start
        print(f"{verdict:8} {mutation.name:32} {seconds:5.1f} s  {line[:150]}", flush=True)
    print(f"{outcomes.count('caught')} of {len(chosen)} mutations caught")
    if "broken" in outcomes:
        return 2
    return 1 if "survived" in outcomes else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
