"""Every number that a check compares with, and the reason for it.

Lengths are in metres and speeds in metres per second; the checks convert from the unit of the cache. Rounding
of points to 32-bit floats is allowed for in the checks, in addition to these numbers.
"""

# Diameters of hair and fur, m: 17 to 180 µm on people, more on creatures and for strands thickened to
# represent several.
WIDTH_M = (5e-6, 2e-3)

# Chord of a render strand's segment against its rest chord, relative. Strands are inextensible by
# construction; 1e-4 is below what is visible and below what length-preserving groom tools resolve.
SEGMENT_DRIFT = 1e-4

# Length of a guide's rod over its chords at rest, minus 1. Between two points a rod turns by at most 0.2 rad
# on a circle, 0.2²/24; at a kink of the groom it may be the 0.4 rad between three, 0.4²/24 = 0.0067. Where a
# hairpin of the groom is narrower than a segment, the rod turns by more, and its chords show by how much. A
# curve that turns by θ < π is at most 1 / cos(θ/2) times as long as its chord, on which its tangents project.
# Between two points θ is at most the sum of the turns from chord to chord there: the tangents at them are
# between the chords. In hairpins of beards and fur, of 0.6 to 2.2 rad at a point, rods are longer by up to
# 0.49 of that.
ARC_OVER_CHORD = 0.01

# Guides lie on smooth inextensible curves: arcs keep their length, chords do not. The arc is measured on the
# cubic through four neighbouring points. Its relative error is below ARC_ERROR × κ²(κ² + τ²)s⁴ for curvature
# κ, torsion τ and the longest segment s of the four points. The largest factor measured on helices is 0.0264
# (tests/python/validator/test_geometry.py). Where the bend changes from point to point, as where a body bends
# hair at its root, that of the turns counts.
ARC_ERROR = 0.03

# Arc of a guide's segment against its rest arc, relative, beyond ARC_ERROR: the curvature of strands in
# contact changes within four points.
GUIDE_SEGMENT_DRIFT = 1e-3

# Length of a whole guide, relative: the errors of its arcs partly cancel.
GUIDE_LENGTH_DRIFT = 5e-4

# Sum of a strand's guide weights, minus 1: three roundings to 32 bits.
WEIGHT_SUM = 1e-6

# Distance of a root from its rest point under the head transform, m. Roots follow the head exactly; this
# covers the rounding of the matrix product.
ROOT_OFFSET_M = 1e-6

# Distance of a root of the groom's curves, in over mode, from its place on the head, m, beyond the rounding
# of points in the world: those of groom, cache and overs are rounded in their own spaces.
OVER_ROOT_M = 2e-6

# Distance of a guide from the curve that leads it, the mean over the part of weight 1 as a share of the
# guide's length, at the 95th percentile of the guides. A guide of 8 nodes follows a ponytail that swings to
# within 0.3 % (docs/benchmarks.md); one that moves on its own is off by a tenth and more.
GOAL = 0.01

# Distance of a baked strand from the curve of the groom that stands for it, the mean over the strand as a
# share of its length, at the 95th percentile of the strands. A B-spline has half as many control points as
# the strand has points, and no kinks: the mean of all strands is 0.1 % (docs/benchmarks.md), that of kinky
# ones several times as much. A curve that moves as another strand is off by a tenth and more.
OVER_SHAPE = 0.02

# How far control points are from where the head carries the groom's own, m, beyond OVER_GAIN times the same
# distance of the farthest point of the strand. The control points of a B-spline swing by up to three times
# as much as the curve; phantom ends are extrapolated, up to three times as far. Without them, the curve ends
# at E = (P'' + 4 P' + P) / 6 of its last control points: P swings six times as far as E if E alone moves.
# OVER_REST_M covers rounding to 32 bits of places in the asset, in the prim and in the strand (5e-7 m each
# at 10 m), which the solve for control points amplifies by as much.
OVER_GAIN = 4.0
OVER_END_GAIN = 6.0
OVER_REST_M = 1e-5

# Distance of guides and skin, at rest in the space of curves that Houdini deforms and in motion in the world,
# from those of the cache, m, beyond rounding to 32 bits in either space. Houdini adds the difference to hair.
DEFORM_M = 1e-6

# Distance of a root from where the skin carries it, m, beyond the rounding of its points and of the mesh's to
# 32 bits. It covers vertices that the bake joins by their 64-bit positions.
SKIN_ROOT_OFFSET_M = 1e-5

# Length of a normal, minus 1, and its cosine with the tangent of the curve, which is that of the parabola
# through the neighbouring points: where a curve turns by 0.4 rad from point to point it is off by 0.03.
NORMAL = 0.1

# Turn of normals about the curve from one point to the next, rad, beyond parallel transport. Guides have a
# segment for each 0.4 rad of their natural shape, and points in its middle.
NORMAL_TWIST = 1.0

# Turn of a root's normal from where the head carries that of the first frame, rad. Both are rounded to 32
# bits.
ROOT_NORMAL = 1e-4

# Distance of points outside their extent, m: one rounding of its corners.
EXTENT_EXCESS_M = 1e-6

# Median over points of the residual of Simpson's rule over two frame intervals, relative to the frame's RMS
# speed, or to a jump of the head's velocity or a share of its speed beside (HEAD_JUMP_SMOOTH,
# HEAD_SPEED_BESIDE) if that is larger: hair that follows it from rest moves by a part of the jump. The rule's
# own error is (ωh)⁴/180: 0.1 % for a shake of 2.5 Hz at 24 frames a second, 2 % at 5 Hz. Velocities that are
# the mean over the last substep add ω·h/16. Velocities per frame, of the wrong sign, or of the neighbouring
# frame give 0.3 and more.
VELOCITY_RESIDUAL = 0.15

# Slower frames are compared with this speed: the velocities of a still groom are rounding errors.
VELOCITY_FLOOR_M_S = 0.02

# The same residual for each curve, relative to its own RMS speed or the head's, at the 95th percentile over
# curves because a few curves collide at any time. The worst frame of the jump and landing described at
# SPIKE_M has 0.15. Fewer wrong curves than one in twenty are not detected.
CURVE_VELOCITY_RESIDUAL = 0.5

# Allowed error of Simpson's rule due to coarse sampling, as a share of the smaller of its difference from the
# trapezoidal rule and that rule's residual. Measured in a landing on the curve at the 95th percentile: 0.42
# for strands, 0.53 for guides, whose residuals fall to 1.5 % and 4 % at four times as many samples. Measured
# over all points of a slow frame of a head that trembles at 8 Hz: 0.29 (0.17 of the speed), which falls to
# 0.01 % at eight times as many samples.
SIMPSON_ERROR = 0.5

# A jump of the head's velocity: the second differences of positions that move with the head, at the two
# frames around it, less this times the root of the sum of squares at the three frames before and the three
# after. With 1.732 and more no sine of any frequency and phase is said to jump. Jumps from rest are found
# whole at any moment between frames, and 52 % of a landing from free fall at 3 m/s.
HEAD_JUMP_SMOOTH = 1.74

# Share of a jump of the head's velocity that may ring a frame before and after it: of a C2 cubic spline
# through samples at the frames 2 - sqrt(3). A landing at 5 m/s rings with 1 cm/s, where the fur on it has
# stopped.
HEAD_RING = 0.27

# Share of the head's speed a frame before or after by which velocities are measured where they are slower. A
# head that whips around within four frames is ten times as fast from one frame to the next; with less, its
# fur, which moves rigidly, has residuals of 0.31. A head that shakes is measured so where it turns, 2.5 or 5
# times a second, by at most a quarter of its largest speed.
HEAD_SPEED_BESIDE = 0.25

# Median over points of the difference between accelerations and the second derivative of the cubic through
# this frame's and the next frame's points and velocities, relative to its RMS. Hair in collision is no cubic
# between frames: 240 frames of a jump and landing have 0.36 in the worst frame and 0.05 in the median.
# Accelerations per frame, of the wrong sign, or zero give 0.6 and more in some frame.
ACCELERATION_RESIDUAL = 0.5

# Between the samples of one frame accelerations are exact except for rounding to 32 bits.
SUB_FRAME_ACCELERATION_RESIDUAL = 1e-3

# Frames with smaller accelerations are compared with this: those of a still groom are rounding errors.
ACCELERATION_FLOOR_M_S2 = 0.5

# One-frame jump in the space of the head, m: second differences at two neighbouring frames with opposite
# directions, over a displacement that exceeds SPIKE_SPEED times the largest speed from the frame before to
# the frame after, and that speed with a jump of the head's velocity (HEAD_JUMP_SMOOTH), by SPIKE_SWING times
# the smaller of the second differences at the frames before and after: with 0.5, no sine of any frequency
# and phase jumps. Render strands may whip as far as their guides. Hair that lands is
# fastest between frames. Measured on a jump and landing of 240 frames at 24 a second with 8 substeps: guides
# that are smooth in every substep have second differences of up to 94 mm and go up to 10 mm beyond 1.5 times
# their speed. A guide that flips over at 2 m/s went 32 mm beyond the speeds at the two frames alone; curls
# flicked by a shaken head go up to 3.7 cm beyond 1.5 times theirs. Baked at 192 frames a second each of their
# steps is smooth.
SPIKE_M = 0.02
SPIKE_SPEED = 1.5
SPIKE_SWING = 0.5

# Segments of guides exempt from contact over all segments. Roots in the skin and hair drawn through an ear
# are 3 % of a film groom; where groom and body are in different spaces, or a body swells over the hair, they
# are nearly all, and the penetration of what contact does not hold says nothing.
EXEMPT_SHARE = 0.5

# Penetration of a collider by a point that is outside it at rest, m. Guides are kept outside by continuous
# collision detection: half a millimetre covers the facets of spheres and capsules and the rounding of points.
# Render strands are interpolated between guides and are not tested against colliders.
GUIDE_PENETRATION_M = 5e-4
HAIR_PENETRATION_M = 2e-3

# Hair pinched between bodies: distance between surfaces that face each other, m, below which there is no
# room for it (points of a curve lie a step apart), and the cosine of their outward normals, negated, from
# which they do (120 degrees: out of a more open groove hair can be squeezed sideways).
PINCH_ROOM_M = 2e-3
PINCH_FACING = 0.5
# Least share of a unit normal across the curve that counts as a direction.
PINCH_ACROSS = 0.3

# Parts of a mesh at an angle: cosine of that between outward normals above which the part is the same, and
# the least of that between the way out of a part and its normal.
PINCH_BENT = 0.5
PINCH_AHEAD = 0.5

# Distance in front of one part of a mesh, m, from which another part is looked at, and up to which.
PINCH_IN_FRONT_M = 1e-4
PINCH_PART_M = 0.1

# A hair whose root is inside a body leaves it along a curve of this radius, m, up to this slope.
PINCH_RADIUS_M = 0.01
PINCH_RISE = 0.5

# Depth from which points are looked at, m, and depth of pinched points beyond the recorded, m.
PINCH_DEPTH_M = 1e-4
PINCH_UNRECORDED_M = 5e-4

# Speed of a point, relative to the larger of VELOCITY_PEAK times the speed of the central difference of its
# positions, and that speed plus VELOCITY_PEAK_M_S. Hair that swings at 7 Hz with 3 cm is sampled badly at 24
# frames a second and stays below 0.6. Streaks in motion blur had 1 to 40. Where a guide turns by more than
# 0.3 rad within half a frame, or the velocity of the head jumps, bakes limit velocities to three times that
# of the central difference, or to that of the head.
VELOCITY_PEAK = 4.0
VELOCITY_PEAK_M_S = 4.0

# There-and-back jump of a render strand within two frames, in the space of the head, m, beyond the largest of
# the guides that it follows, and beyond POP_SPEED times the way of a frame at the larger of its speeds at the
# frames before and after: of a parabola that turns at the frame, all. Strands that whip between guides of
# which one rests go up to 5.3 cm beyond the guides, and up to 3.4 cm beyond their speeds; at 192 frames a
# second each of their steps is smooth. Strands that left their guides went 15 cm. Where only one frame is
# wrong, the speeds around account for a sixth of the jump by fourth-order differences over half frames, and
# for a fourth of it if they are central differences over frames.
POP_M = 0.04
POP_SPEED = 0.5

# Distance of the median root from a skin beyond which it is not where the hair grows, m, and as a share of
# the diagonal of the roots' bounding box: 5 cm on a human head. Production roots are within millimetres of
# the skin, within a centimetre of a coarse collider. A character placed elsewhere is off by metres.
OFF_SKIN_M = 0.02
OFF_SKIN_SHARE = 0.15
