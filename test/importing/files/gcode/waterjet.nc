(an imitation of a program for a water jet)
G20
G90
G92 X0 Y0
M0 (CHECK PRESSURE)
G0 X1. Y1.
M7
G4 X.5
G1 X3. F25.
G2 X3. Y2. I0. J.5
G1 X1.
Y1.
M9
G0 X0 Y0
M2
