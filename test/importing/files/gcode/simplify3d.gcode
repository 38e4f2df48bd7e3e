; an imitation of Simplify3D 4.1
; Settings Summary
;   extruderDiameter,0.4
G90
M82
M106 S0
M140 S60
M190 S60
M104 S200 T0
M109 S200 T0
G28 ; home all axes
; process Process1
; layer 1, Z = 0.180
T0
G92 E0.0000
G1 E-1.0000 F1800
; feature skirt
; tool H0.1800 W0.4800
G1 Z0.180 F1002
G1 X92.000 Y92.000 F4800
G1 E0.0000 F1800
G92 E0.0000
G1 X108.000 Y92.000 E0.5173 F1200
G1 X108.000 Y108.000 E1.0346
G1 X92.000 Y108.000 E1.5519
G1 X92.000 Y92.000 E2.0692
; layer end
M104 S0 ; turn off extruder
M140 S0 ; turn off bed
M84 ; disable motors
