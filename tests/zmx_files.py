"""Zemax and ISET3d lens files, written here from published prescriptions."""

# The wide-angle eye of Navarro (Escudero-Sanz & Navarro 1999), with indices and Abbe numbers that
# fit his four wavelengths, as in the public program visisipy.
NAVARRO = """\
VERS 140124 258 36214
MODE SEQ
NAME Navarro wide-angle eye
UNIT MM X W X CM MR CPMM
FLOA
FTYP 0 0 1 3 0 0 0
WAVM 1 4.8613270000000001E-1 1
WAVM 2 5.8756180000000002E-1 1
WAVM 3 6.5627249999999998E-1 1
PWAV 2
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ INFINITY
  DIAM 0 0 0 0 1 ""
SURF 1
  COMM cornea front
  TYPE STANDARD
  CURV 1.2953367875647670E-001 0 0 0 0 ""
  CONI -0.26
  DISZ 0.55
  GLAS ___BLANK 1 0 1.37609 53.05 0 0 0 0 0 0
  DIAM 5.5 1 0 0 1 ""
SURF 2
  COMM cornea back
  TYPE STANDARD
  CURV 1.5384615384615385E-001 0 0 0 0 ""
  DISZ 3.05
  GLAS ___BLANK 1 0 1.33745 48.50 0 0 0 0 0 0
  DIAM 1.2 0 0 0 1 ""
SURF 3
  STOP
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ 0
  GLAS ___BLANK 1 0 1.33745 48.50 0 0 0 0 0 0
  DIAM 1.5 1 0 0 1 ""
SURF 4
  COMM lens front
  TYPE STANDARD
  CURV 9.8039215686274508E-002 0 0 0 0 ""
  CONI -3.1316
  DISZ 4
  GLAS ___BLANK 1 0 1.42011 46.38 0 0 0 0 0 0
  DIAM 1.5 0 0 0 1 ""
SURF 5
  COMM lens back
  TYPE STANDARD
  CURV -1.6666666666666666E-001 0 0 0 0 ""
  CONI -1
  DISZ 16.3203
  GLAS ___BLANK 1 0 1.33609 49.69 0 0 0 0 0 0
  DIAM 1.3 0 0 0 1 ""
SURF 6
  COMM retina
  TYPE STANDARD
  CURV -8.3333333333333329E-002 0 0 0 0 ""
  DISZ 0
  DIAM 0.01 0 0 0 1 ""
"""

# An eye with every kind of surface: an aspheric cornea whose back carries Zernike polynomials, a
# decentred and tilted lens with a biconic front, and a break that undoes the first.
TILTED = """\
MODE SEQ
UNIT CM X W X CM MR CPMM
ENPD 0.3
WAVM 1 0.55 1
PWAV 1
SURF 0
  DISZ INFINITY
SURF 1
  TYPE EVENASPH
  CURV 1.25
  CONI -0.2
  PARM 1 0.01
  PARM 2 0.03
  PARM 3 -0.02
  DISZ 0.05
  GLAS ___BLANK 1 0 1.376 0 0 0 0 0 0 0
SURF 2
  TYPE SZERNSAG
  CURV 1.5
  XDAT 1 8 0 0 0
  XDAT 2 0.3 0 0 0
  XDAT 7 0.0002 0 0 0
  XDAT 8 -0.0003 0 0 0
  XDAT 10 0.0001 0 0 0
  DISZ 0.3
  GLAS ___BLANK 1 0 1.336 0 0 0 0 0 0 0
SURF 3
  STOP
  DISZ 0.01
  GLAS ___BLANK 1 0 1.336 0 0 0 0 0 0 0
SURF 4
  TYPE COORDBRK
  PARM 1 0.02
  PARM 2 -0.03
  PARM 3 4.0
  PARM 4 -3.0
  PARM 5 20.0
  PARM 6 0
  DISZ 0.0
SURF 5
  TYPE STANDARD
  CURV 0.95
  CONI -1.5
  DISZ 0.4
  GLAS ___BLANK 1 0 1.42 0 0 0 0 0 0 0
SURF 6
  CURV -1.7
  CONI -0.8
  DISZ -0.4
  GLAS ___BLANK 1 0 1.337 0 0 0 0 0 0 0
SURF 7
  TYPE COORDBRK
  PARM 1 -0.02
  PARM 2 0.03
  PARM 3 -4.0
  PARM 4 3.0
  PARM 5 -20.0
  PARM 6 1
  DISZ 2.0
SURF 8
  CURV -0.8
"""

# ISET3d: Navarro's eye with a cornea of two radii.
ISET3D = """\
# Focal length (mm)
16.500
# radiusX radiusY thickness materialIndex semiDiameter conicConstantX conicConstantY
-7.72\t-7.5\t0.55\t1\t4.82\t-0.26\t-0.2
-6.5\t-6.5\t3.05\t2\t4.341\t0\t0
0\t0\t0\t2\t2\t0\t0
-10.2\t-10.2\t4.0\t3\t3.75\t-3.1316\t-3.1316
6.0\t6.0\t0\t4\t3.75\t-1\t-1
# accommodation 0
"""
