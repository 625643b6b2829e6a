"""Owns the columns of a record: those of the whole scene, then PASS_COLUMNS for each of its contact passes."""

# Energies [J], greatest deviatoric strain and least ratio of volumes [-], works done [J]; of a chain's joints and base,
# work put in, heat of friction, and kinetic energy of the carriage [J]; what bulk viscosity took [J]:
KINETIC, GRAVITY_WORK, ELASTIC, PLASTIC, STRAIN, JACOBIAN, HOURGLASS, DRIVE_WORK = range(8)
LOAD_WORK, JOINT_HEAT, CARRIAGE, VISCOUS, PASS = range(8, 13)

# Of a pass, as `kernels.contact.spring_sums.sum_springs` sums them. Since the last row of the history: the whole
# force, the normal forces and those of sticking nodes, each summed over the steps [N]. At the record: vector sum of
# the normal forces [N], their sum [N], energy of the normal springs [J], energy that springs lost as they became
# softer [J], sum of the squares of the normal forces [N^2], energy that springs made, and energy that dashpots
# of contact laws dissipated [J].
SPRING_ENERGY, FRICTION, PLANE_WORK = 0, 1, 2
IMPULSE, NORMAL_IMPULSE, STICK_IMPULSE = slice(3, 6), 6, 7
NORMAL_FORCE, PRESSURE, NORMAL_ENERGY, LOST, SQUARES, MADE = slice(8, 11), 11, 12, 13, 14, 15
DAMPED = 16
PASS_COLUMNS = 17

# Behind the passes stand the columns of other actors, see `system.columns`. Of absorbing boundaries: energy that bodies
# gave to what lies beyond them, in the frame of the body, and work that this does on the bodies as it moves along [J].
ABSORBED, BEYOND_WORK = 0, 1
