"""Every number that a check compares with, in one place, each with its reason.

Lengths are in metres and speeds in metres per second; the checks convert from the cache's own unit.
"""

# Widths (diameters) of hair and fur in metres: 17-180 µm on people, more on creatures and for strands
# thickened to stand for several.
WIDTH_M = (5e-6, 2e-3)

# Segment lengths of render strands: chord against rest chord, relative, beyond the rounding of the
# coordinates to 32 bits. Strands are inextensible by construction; 1e-4 is what the eye and a length-
# preserving groom tool can never see.
SEGMENT_DRIFT = 1e-4

# Guides lie on smooth inextensible curves, so arcs keep their length and chords do not. The arc is that
# of the cubic through four neighbouring points. Its relative error is below ARC_ERROR × κ²(κ² + τ²)s⁴ for
# curvature κ, torsion τ and the longest segment s of the four points; measured on helices of all kinds at
# 0.0264, see tests/test_geometry.py. GUIDE_SEGMENT_DRIFT is what is asked beyond that, for strands whose
# curvature changes within four points, as in contact.
ARC_ERROR = 0.03
GUIDE_SEGMENT_DRIFT = 1e-3

# The sum of the weights of the guides that a strand follows, off 1: three roundings to 32 bits.
WEIGHT_SUM = 1e-6

# The whole length of a guide: the errors of its arcs partly cancel, so less is let pass.
GUIDE_LENGTH_DRIFT = 5e-4

# A root off the head transform, beyond the rounding of rest and world coordinates. Nothing physical moves
# a root, so this only keeps clear of the rounding of the transform's own product.
ROOT_OFFSET_M = 1e-6

# Points outside the extent, beyond one rounding of its corners.
EXTENT_EXCESS_M = 1e-6

# Median over points of the velocity residual, relative to the frame's root mean square speed. The
# residual is that of Simpson's rule over two frame intervals: its own error is (ωh)⁴/180, 0.1 % for a 2.5
# Hz shake at 24 frames a second and 2 % at 5 Hz. Solvers that return the last substep's mean velocity add
# ω·h/16. Velocities per frame, of the wrong sign, or of the neighbouring frame give 0.3 and more.
VELOCITY_RESIDUAL = 0.15
# Frames slower than this are compared with this speed: a still groom has rounding for a velocity.
VELOCITY_FLOOR_M_S = 0.02

# The same residual of single curves, relative to their own speed, at the 95th percentile over the curves: a few
# curves hit something at any time. Measured on the jump and landing described below: 0.15 in the worst frame. Fewer
# wrong curves than one in twenty go unseen.
CURVE_VELOCITY_RESIDUAL = 0.5

# How far Simpson's rule may be off by the sampling alone, as a share of its difference from the trapezoidal rule and of that rule's own error. Measured in a landing, on
# the curve at the 95th percentile: 0.42 for strands, 0.53 for guides, whose velocities, sampled four times as often, integrate to 1.5 % and 4 %;
# over all points, in a slow moment of a head that trembles at some 8 Hz: 0.17 of their speed are 0.29 of it, and 0.01 % is left at eight times as many moments.
SIMPSON_ERROR = 0.5

# Median over points of what accelerations differ from the second derivative of the cubic through this frame's and the next one's points and
# velocities, relative to its root mean square. Hair that hits something is no cubic between frames: 0.36 in the worst of 240 frames of a jump
# and landing, 0.05 in the median. Accelerations per frame, of the wrong sign, or none give 0.6 and more in some frame.
ACCELERATION_RESIDUAL = 0.5
# Between moments of one frame they are exact, but for rounding to 32 bits.
SUB_FRAME_ACCELERATION_RESIDUAL = 1e-3
# Frames with less are compared with this: a still groom has rounding for an acceleration.
ACCELERATION_FLOOR_M_S2 = 0.5

# A one-frame jump, seen from the head: |second difference| at two neighbouring frames with opposite
# directions, over a way that SPIKE_SPEED times the greatest of the speeds from the frame before to the frame after
# does not account for: hair that lands is fastest between frames.
# Measured on a jump and landing of 240 frames at 24 a second with 8 sub-steps: guides whose every sub-step
# is smooth have second differences of up to 94 mm, and go 10 mm beyond 1.5 times their speed. A guide that flips over
# at 2 m/s went 32 mm beyond the speeds at the two frames alone; baked at 192 frames a second each of its steps is smooth.
SPIKE_M = 0.02
SPIKE_SPEED = 1.5

# Penetration of a collider by a point that was outside it in the rest pose. Guides are kept outside by
# continuous collision detection: half a millimetre allows for the facets of a sphere or capsule and for
# the rounding of points. Render strands are interpolated between guides and meet no collider of their
# own.
GUIDE_PENETRATION_M = 5e-4
HAIR_PENETRATION_M = 2e-3
