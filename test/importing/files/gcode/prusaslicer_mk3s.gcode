; an imitation of PrusaSlicer 2.7 for a Prusa MK3S: a frame of 20 mm, one layer

; external perimeters extrusion width = 0.45mm
M73 P0 R1
M73 Q0 S1
M201 X1000 Y1000 Z200 E5000 ; sets maximum accelerations, mm/sec^2
M203 X200 Y200 Z12 E120 ; sets maximum feedrates, mm / sec
M204 P1250 R1250 T1250 ; sets acceleration (P, T) and retract acceleration (R)
M205 X8.00 Y8.00 Z0.40 E4.50 ; sets the jerk limits, mm/sec
M205 S0 T0 ; sets the minimum extruding and travel feed rate, mm/sec
;TYPE:Custom
M862.3 P "MK3S" ; printer model check
M862.1 P0.4 ; nozzle diameter check
M115 U3.13.2 ; tell printer latest fw version
G90 ; use absolute coordinates
M83 ; extruder relative mode
M104 S215 ; set extruder temp
M140 S60 ; set bed temp
M190 S60 ; wait for bed temp
M109 S215 ; wait for extruder temp
G28 W ; home all without mesh bed level
G80 ; mesh bed leveling
G1 Z0.2 F720
G1 Y-3 F1000 ; go outside print area
G92 E0
G1 X60 E9 F1000 ; intro line
G1 X100 E12.5 F1000 ; intro line
G92 E0
M221 S95
M900 K0.05 ; Filament gcode LA 1.5
G21 ; set units to millimeters
G90 ; use absolute coordinates
M83 ; use relative distances for extrusion
;LAYER_CHANGE
;Z:0.2
;HEIGHT:0.2
G1 E-.8 F2100
G1 Z.4 F10800
G1 X115 Y95
G1 Z.2
G1 E.8 F2100
;TYPE:External perimeter
;WIDTH:0.45
G1 F1200
G1 X135 Y95 E.62714
G1 X135 Y115 E.62714
G1 X115 Y115 E.62714
G1 X115 Y95.45 E.61303
;WIPE_START
G1 F8640
G1 X115 Y97 E-.76
;WIPE_END
G1 E-.04 F2100
M107
M73 P100 R0
G4 ; wait
M221 S100 ; reset flow
M104 S0 ; turn off temperature
M84 X Y E ; disable motors
; prusaslicer_config = begin
; gcode_flavor = marlin
; prusaslicer_config = end
