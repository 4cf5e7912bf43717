-1 1  0 1  0 1
CONTACT POINT X: 0 Y: 0 Z: 0
END POINT X: 0 Y: 0 Z: 0
HEADING X: 0 Y: 0 Z: 1
UP X: 0 Y: 1 Z: 0
SIZE: 1
patch
TOP COLOR: 0 DIFFUSE: 0 BOTTOM COLOR: 0 DIFFUSE: 0
AL: ~ A: ~ AR: ~
L: ~ R: ~
BL: ~ B: ~ BR: ~
0 0 0  0 0 0  0 0 0  0 0 0
-0.75 0 0.2  -0.25 0 0.2  0.25 0 0.2  0.75 0 0.2
-0.4 0.1 0.8  -0.2 0.3 0.3  0.2 0.3 0.3  0.4 0.1 0.8
0 0 1  0 0 1  0 0 1  0 0 1
