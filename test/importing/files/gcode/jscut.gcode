; an imitation of jscut
G20         ; Set units to inches
G90         ; Absolute positioning
G1 Z1 F100      ; Move to clearance level

;
; Operation:    0
; Type:         Pocket
; Paths:        1
;

; Path 0
; Rapid to initial position
G1 X0.5000 Y-0.5000 F100
G1 Z0.0000
; plunge
G1 Z-0.1250 F5
; cut
G1 X1.5000 Y-0.5000 F20
G1 X1.5000 Y-1.0000
G1 X0.5000 Y-1.0000
G1 X0.5000 Y-0.5000
; Retract
G1 Z1.0000 F100
M2
