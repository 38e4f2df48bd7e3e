; an imitation of a plotter with GRBL: S is the angle of a servo
G21G90
M3S30
G0X10Y10
M3S90
G1X40F1500
Y30
S30
G0X0Y0
M5
