"""tracemesh: curve networks and surfaces from orientations measured along curves.

Conventions used everywhere (docs/conventions.md): metres, radians, seconds; right-handed; Earth frame ENU; a frame is
the matrix A = [t N B] with the tangent, the outward normal and B = t x N as columns, mapping frame to world.
"""
