(an imitation of FreeCAD 0.21, grbl_post)
(Begin preamble)
G17 G90
G21
(Begin operation: Pocket)
(Path: Pocket)
M3 S10000
G0 Z5.000
G0 X15.000 Y10.000
G1 X15.000 Y10.000 Z-0.500 F120.000
G3 X5.000 Y10.000 I-5.000 J0.000 K0.000 F300.000
G3 X15.000 Y10.000 I5.000 J0.000 K0.000
G0 Z5.000
(Finish operation: Pocket)
(Begin postamble)
M5
G17 G90
M2
