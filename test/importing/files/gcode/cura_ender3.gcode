;an imitation of Cura 5 for an Ender 3
;FLAVOR:Marlin
;TIME:41
;MINX:105
;Generated with Cura_SteamEngine 5.4.0
M140 S50
M105
M190 S50
M104 S200
M105
M109 S200
M82 ;absolute extrusion mode
; Ender 3 Custom Start G-code
G92 E0 ; Reset Extruder
G28 ; Home all axes
G1 Z2.0 F3000 ; Move Z Axis up little to prevent scratching of Heat Bed
G1 X0.1 Y20 Z0.3 F5000.0 ; Move to start position
G1 X0.1 Y200.0 Z0.3 F1500.0 E15 ; Draw the first line
G1 X0.4 Y200.0 Z0.3 F5000.0 ; Move to side a little
G1 X0.4 Y20 Z0.3 F1500.0 E30 ; Draw the second line
G92 E0 ; Reset Extruder
G1 Z2.0 F3000
G92 E0
G92 E0
G1 F2700 E-5
;LAYER_COUNT:1
;LAYER:0
M107
M204 S500
M205 X8 Y8
;MESH:box.stl
G0 F6000 X105 Y105 Z0.2
;TYPE:WALL-OUTER
G1 F2700 E0
G1 F1200 X125 Y105 E0.6652
G1 X125 Y125 E1.3304
G1 X105 Y125 E1.9956
G1 X105 Y105 E2.6608
G0 F6000 X105.2 Y105.2
;TIME_ELAPSED:41.0
M140 S0
M107
G91 ;Relative positioning
G1 E-2 F2700 ;Retract a bit
G1 E-2 Z0.2 F2400 ;Retract and raise Z
G1 X5 Y5 F3000 ;Wipe out
G1 Z10 ;Raise Z more
G90 ;Absolute positioning
G1 X0 Y220 ;Present print
M106 S0 ;Turn-off fan
M104 S0 ;Turn-off hotend
M140 S0 ;Turn-off bed
M84 X Y E ;Disable all steppers but Z
M82 ;absolute extrusion mode
;End of Gcode
