/* closure.cl - what a material does at a point, with everything read from tables.
 *
 * Every material offers eval, pdf and sample in the frame of the surface:
 *   eval     BSDF times |cos| for the four wavelengths
 *   pdf      density per solid angle with which sample draws a direction
 *   sample   a direction, with eval / pdf; a density of -1 stands for a direction without spread,
 *            and 0 for none at all
 * wo points to the viewer and has z > 0; wi points to the light, behind the surface where z < 0.
 */
#include "lib/frame.cl"

typedef struct {
  int kind;        /* of the whole group */
  int is_polished; /* roughness is 0 everywhere */
  realv alpha;     /* GGX width */
  realv index;     /* refractive index of the far side over the near side, or of a coat */
  realv inner;     /* share of diffuse light that a coat sends back down */
  colourv albedo;  /* reflectance; real part of a metal's index */
  colourv other;   /* transmittance; extinction coefficient of a metal */
} closurev;
