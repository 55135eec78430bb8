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

# What OpticStudio 20 to 25 writes besides, by files of theirs that were read; the order is theirs.
_HEAD = """\
VERS 250117 25101 37178 37178
MODE SEQ
NAME Navarro wide-angle eye
AUTH
PFIL 0 0 0
LANG 0
UNIT MM X W X CM MR CPMM LU
FLOA
ENVD 20 1 0
GFAC 0 0
GCAT SCHOTT MISC
RAIM 0 0 1 1 0 0 0 0 0 1
PUSH 0 0 0 0 0 0
SDMA 0 1 0
OMMA 1 1
FTYP 0 0 1 3 0 0 0 1
ROPD 2
HYPR 0
PICB 1
XFLN 0 0 0 0 0 0 0 0 0 0 0 0
YFLN 0 5 10 0 0 0 0 0 0 0 0 0
FWGN 1 1 1 1 1 1 1 1 1 1 1 1
VDXN 0 0 0 0 0 0 0 0 0 0 0 0
"""
_TAIL = """\
BLNK Sequential merit function: RMS wavefront centroid GQ 3 rings 6 arms
DMFS 0 0 0 0 0 0 0 0 0 0
TRAC 0 1 0 0 0.33571068701972881 0 0 0.87266462599716477 0 0
CONI 2 0 0 0 0 0 0.5 1 0 0
TOL TOFF   0   0 0.0000000000000000E+00 0.0000000000000000E+00   0 0 0 0 0
MNUM 2 1
MOFF   0   1 "" 0 0 0 1 1 0 0.0 "" 0
CURV   4   1 "" 0 0 0 1 1 0 0.2 "" 0
STOP   2   2 "" 0 0 0 1 1 0 2.0 "" 0
"""


def as_opticstudio_writes() -> str:
    """NAVARRO with all the lines that its own program writes, and its line ends."""
    waves = [f"WAVM {i} 5.5000000000000004E-01 1" for i in range(4, 25)]
    head = [*_HEAD.splitlines(), *NAVARRO[NAVARRO.index("WAVM 1") :].splitlines()[:3], *waves]
    head += ["PWAV 2", "POLS 1 0 1 0 0 1 0", "GLRS 1 0", "GSTD 0 100.000 0 1 1 0 0 1 1 1 1 1 1"]
    head += ["NSCD 100 500 0 0.001 10 9.9999999999999995e-07 0 0 0 0 0 0 1000000 0 2"]
    head += ['COFN QF "COATING.DAT" "SCATTER_PROFILE.DAT" "ABG_DATA.DAT" "PROFILE.GRD"']
    body = []
    for line in NAVARRO[NAVARRO.index("SURF 0") :].splitlines():
        body.append(line)
        if line.startswith("  TYPE"):
            body.append("  FIMP ")
        elif line.startswith("  CURV"):
            body += ["  HIDE 0 0 0 0 0 0 0 0 0 0", "  MIRR 2 0", "  SLAB 1"]
        elif line.startswith("  DISZ 3.05"):
            body.append("  PZUP 2 1 0 0")
        elif line.startswith("  DIAM"):
            body += ['  MEMA 5.5 0 0 0 1 ""', "  OBDC 0.000000000000E+00 0.000000000000E+00"]
            body += ["  SCBD 1 0 0 0 0 0 0 0 0 0", "  POPS 0 0 0 0 0 0 0 0 1 1 1 1 0 0 0 0"]
    return "\r\n".join([*head, *body, *_TAIL.splitlines(), ""])


# A lens of n = 1.5 behind its stop, whose reports by OpticStudio 25.1.1 are public.
SINGLET = """\
MODE SEQ
UNIT MM X W X CM MR CPMM
FLOA
WAVM 1 0.543 1
PWAV 1
SURF 0
  DISZ INFINITY
SURF 1
  STOP
  CURV 0.0
  DISZ 0
  DIAM 1 1 0 0 1 ""
SURF 2
  CURV 0.05
  DISZ 1
  GLAS ___BLANK 1 0 1.5 0 0 0 0 0 0 0
  DIAM 1 0 0 0 1 ""
SURF 3
  CURV -0.05
  DISZ 19.792
  DIAM 0.98413862980615852 0 0 0 1 ""
SURF 4
  CURV 0.0
  DISZ 0
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
