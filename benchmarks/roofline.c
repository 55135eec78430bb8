/* roofline.c - the fastest plain C we could write for a collimated beam through Navarro's eye.
 *
 * A yardstick for isetcl.trace_rays: one fixed eye, constants known to the compiler, structure of
 * arrays, blocks that stay in the first-level cache, vectorised by the compiler, one thread a core.
 * It takes heights (x, y) of rays parallel to the axis and gives (x, y) on the retina, 0 for rays
 * that the stop holds back; no status, no directions, no path lengths, no hard cases.
 *
 * cc -O3 -march=native -ffast-math -fopenmp -DREAL=float roofline.c -o roofline -lm
 * Prints: rays, seconds of wall clock and of process time of every repetition, and the spot's RMS.
 */
#include <tgmath.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define SURFACES 5
#define BLOCK 512

static const REAL radius[SURFACES] = {7.72, 6.5, 10.2, -6.0, -12.0};
static const REAL conic[SURFACES] = {-0.26, 0, -3.1316, -1, 0};
static const REAL thickness[SURFACES] = {0.55, 3.05, 4.0, 16.3203, 0};
static const REAL n_after[SURFACES] = {1.376, 1.3374, 1.42, 1.336, 1.336};
static const REAL stop_radius2 = (REAL)4.0000001;
enum { LENS_FRONT = 2 };

static void trace_block(const REAL *restrict x_in, const REAL *restrict y_in, REAL *restrict x_out,
                        REAL *restrict y_out, int count) {
  REAL x[BLOCK], y[BLOCK], z[BLOCK], dx[BLOCK], dy[BLOCK], dz[BLOCK], seen[BLOCK];
  for (int i = 0; i < count; ++i) {
    x[i] = x_in[i];
    y[i] = y_in[i];
    z[i] = -1;
    dx[i] = dy[i] = 0;
    dz[i] = seen[i] = 1;
  }
  REAL n = 1;
  for (int s = 0; s < SURFACES; ++s) {
    const REAL c = 1 / radius[s], kappa = 1 + conic[s], ratio = n / n_after[s];
    const REAL gap = thickness[s];
#pragma omp simd
    for (int i = 0; i < count; ++i) {
      REAL to_plane = -z[i] / dz[i];
      REAL px = x[i] + to_plane * dx[i], py = y[i] + to_plane * dy[i];
      if (s == LENS_FRONT) seen[i] *= px * px + py * py <= stop_radius2;
      REAL a = c * (dx[i] * dx[i] + dy[i] * dy[i] + kappa * dz[i] * dz[i]);
      REAL b = dz[i] - c * (px * dx[i] + py * dy[i]);
      REAL g = c * (px * px + py * py);
      REAL t = g / (b + sqrt(b * b - a * g));
      px += t * dx[i];
      py += t * dy[i];
      REAL pz = t * dz[i];
      REAL nx = -c * px, ny = -c * py, nz = 1 - c * kappa * pz;
      REAL scale = 1 / sqrt(nx * nx + ny * ny + nz * nz);
      nx *= scale;
      ny *= scale;
      nz *= scale;
      REAL cosine = dx[i] * nx + dy[i] * ny + dz[i] * nz;
      REAL bend = sqrt(1 - ratio * ratio * (1 - cosine * cosine)) - ratio * cosine;
      dx[i] = ratio * dx[i] + bend * nx;
      dy[i] = ratio * dy[i] + bend * ny;
      dz[i] = ratio * dz[i] + bend * nz;
      x[i] = px;
      y[i] = py;
      z[i] = pz - gap;
    }
    n = n_after[s];
  }
  for (int i = 0; i < count; ++i) {
    x_out[i] = x[i] * seen[i];
    y_out[i] = y[i] * seen[i];
  }
}

static double process_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return t.tv_sec + 1e-9 * t.tv_nsec;
}

int main(int argc, char **argv) {
  const int rays = argc > 1 ? atoi(argv[1]) : 1000000;
  const int repetitions = argc > 2 ? atoi(argv[2]) : 30;
  const size_t bytes = (rays * sizeof(REAL) + 127) / 64 * 64;
  REAL *x = aligned_alloc(64, bytes), *y = aligned_alloc(64, bytes);
  REAL *u = aligned_alloc(64, bytes), *v = aligned_alloc(64, bytes);
  const double edge = 2.2449628747094807, turn = M_PI * (3 - sqrt(5));
  for (int i = 0; i < rays; ++i) {
    double r = edge * sqrt((i + 0.5) / rays);
    x[i] = r * cos(i * turn);
    y[i] = r * sin(i * turn);
  }
  printf("%d\n", rays);
  for (int k = 0; k <= repetitions; ++k) {
    double wall = omp_get_wtime(), cpu = process_seconds();
#pragma omp parallel for schedule(static)
    for (int b = 0; b < rays; b += BLOCK)
      trace_block(x + b, y + b, u + b, v + b, rays - b < BLOCK ? rays - b : BLOCK);
    wall = omp_get_wtime() - wall;
    cpu = process_seconds() - cpu;
    if (k > 0) printf("%.9f %.9f\n", wall, cpu);
  }
  double sum = 0;
  for (int i = 0; i < rays; ++i) sum += (double)u[i] * u[i] + (double)v[i] * v[i];
  printf("rms %.15g\n", sqrt(sum / rays));
  return 0;
}
