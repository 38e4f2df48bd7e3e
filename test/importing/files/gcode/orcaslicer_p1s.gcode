; HEADER_BLOCK_START
; an imitation of OrcaSlicer for a Bambu P1S
; total layer number: 1
; HEADER_BLOCK_END
; EXECUTABLE_BLOCK_START
M73 P0 R1
M201 X20000 Y20000 Z500 E5000
M203 X500 Y500 Z20 E30
M204 P20000 R5000 T20000
M205 X9.00 Y9.00 Z3.00 E2.50
;===== machine: P1S ========================
M106 P3 S180 ; Prevent PLA from jamming
M412 S1 ; ===turn on filament runout detection===
M17 Z0.4 ; lower the z-motor current
M1002 gcode_claim_action : 2
M1002 set_filament_type:PLA
M975 S1 ; turn on vibration suppression
G90
M220 S100 ; Reset Feedrate
M73.2 R1.0 ; Reset left time magnitude
M221 X0 Y0 Z0 ; turn off soft endstop
G29.2 S0 ; turn off bed leveling
M204 S10000
G28 X
G91
G1 Z10 F1200
G90
M620 S0A ; switch material
M620.1 E F299.339 T240
T0
M621 S0A
G29.1 Z0 ; clear z-trim value first
G28 Z P0 T250
M970.3 Q1 A7 B30 C80 H15 K0
M974 Q1 S2 P0
G92 E0
M83
G21
G29.2 S1
M1002 judge_flag g29_before_print_flag
M622 J1
  M1002 gcode_claim_action : 1
  G29 A1 O X118 Y118 I20 J20 R
M623
M622 J0
  G28
M623
G150.3
; MACHINE_START_GCODE_END
M106 S0
; CHANGE_LAYER
; Z_HEIGHT: 0.2
M991 S0 P0 ;notify layer change
; OBJECT_ID: 23
M486 S0
M486 AName
G1 X128 Y118 Z.6 F30000
G1 Z.2
M204 S500
; FEATURE: Outer wall
G1 F3000
G1 X138 Y118 E.38
G3 X138 Y138 I0 J10 E.6
G1 X118 Y138 E.76
G1 X118 Y118.2 E.75
M624 AQAAAAAAAAA=
M625
M106 S255
M400 ; wait for buffer to clear
M17 S
M18 E
M104 S0 ; turn off hotend
M73 P100 R0
; EXECUTABLE_BLOCK_END
