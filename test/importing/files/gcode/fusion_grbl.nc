(an imitation of Fusion's GRBL post)
(1001)
(T1 D=6. CR=0. - ZMIN=-2. - flat end mill)
G90 G94
G17
G21
(When using Fusion for Personal Use, the feedrate of)
(rapid moves is reduced)

(2D Contour1)
G54
M9
S18000 M3
G0 X-3. Y10.
Z15.
Z5.
G1 Z1. F333.3
Z-2.
X0. F1000.
Y30.
G2 X5. Y35. I5. J0.
G1 X25.
G2 X30. Y30. I0. J-5.
G1 Y5.
G3 X25. Y0. I-5. J0.
G0 Z15.
M5
M30
