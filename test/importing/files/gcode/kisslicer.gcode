; an imitation of KISSlicer 1.6
; *** Prefix ***
G21
G90
M82
; BEGIN_LAYER_OBJECT z=0.250 z_thickness=0.250
;
; 'Loop Path', 0.5 [feed mm/s], 20.0 [head mm/s]
G28
G92 E0
G1 X20 Y20 Z0.25 F6000
G1 X60 Y20 E2.1 F1200
G1 X60 Y45 E3.4
G1 X20 Y45 E5.5
G1 X20 Y20 E6.8
; END_LAYER_OBJECT z=0.250
; *** Postfix ***
M84
