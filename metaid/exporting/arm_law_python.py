"""What the source text of an arm's law in Python is filled into. A word after a dollar sign is a constant of the
model. A line after %word is left out where the model has no such thing, one after %!word where it has; %dahl is
pre-sliding, %pairs are coupled motors.
"""

ARM_PYTHON = '''
import math

GRAVITY = $gravity  # in the frame of the base, in m/s^2
# Of each joint: origin of its frame in the frame before, in m; axes of its frame at q = 0 (the columns); its axis.
POSITION = $position
ROTATION = $rotation
AXIS = $axis
SLIDES = $slides  # 1 of a slide, 0 of a hinge
# Of each link, about the origin of its frame: mass in kg, first moment in kg m, moments of inertia in kg m^2.
MASS = $mass
MOMENT = $moment
INERTIA = $inertia
ROTOR = $rotor  # of each joint, in kg m^2 (kg): what turns with its motor
%!pairs # Of each joint:
%pairs # Of each joint, and then of each pair of COUPLED:
DAMPING = $damping  # viscous friction, in N m s (N s/m)
COULOMB = $coulomb  # dry friction, in N m (N)
%root ROOT = $root  # dry friction for a unit of the root of the speed, in N m s^0.5
STILL = $still  # rad/s (m/s): what is slower has that share of its dry friction
%bent BENT = $bent  # rad/s (m/s): where it is above 0 tanh(speed / BENT) is that share
%dahl PRESLIDING = $presliding  # rad (m) over which dry friction builds up; where it is 0 STILL counts
%load # Of each joint: dry friction as a share of the size of the torque of bodies and rotors.
%load LOAD = $load
%offset OFFSET = $offset  # of each joint, in N m (N): torque that is always there
%spring SPRING = $spring  # of each joint, in N m/rad (N/m): torque that grows with q
%pairs COUPLED = $coupled  # pairs of joints, from 0 on, each with a motor that turns with the sum of both
%pairs COUPLED_ROTOR = $coupled_rotor  # of each of these motors, in kg m^2


def torque(q, qd):
    """The joint torques, in N m (of a slide in N), that leave nothing to accelerate the arm.

    q are joint coordinates in rad (m), qd joint speeds in rad/s (m/s).
    """
    return inverse_dynamics(q, qd, [0.0] * len(MASS))


%!dahl def inverse_dynamics(q, qd, qdd):
%dahl def inverse_dynamics(q, qd, qdd, slip=None):
    """The joint torques, in N m (of a slide in N), that give the joints accelerations qdd, in rad/s^2 (m/s^2).

    q, qd and qdd are each of one state, or rows of states; so are the torques.
%dahl
%dahl     Rows are in the order of time: dry friction follows the motion, from `slip` on. Of one state it is what `slip`
%dahl     says; where there is none, what the speeds say.
    """
    if hasattr(q[0], "__len__"):
%!dahl         return [inverse_dynamics(*state) for state in zip(q, qd, qdd)]
%dahl         rows, before = [], q[0]
%dahl         for state in zip(q, qd, qdd):
%dahl             slip = slide(slip, [after - each for each, after in zip(before, state[0])])
%dahl             rows.append(inverse_dynamics(*state, slip))
%dahl             before = state[0]
%dahl         return rows
    q, qd, qdd = ([float(each) for each in values] for values in (q, qd, qdd))
    torques = _rigid(q, qd, qdd, GRAVITY)
%pairs     speeds = qd + [qd[i] + qd[j] for i, j in COUPLED]
%!pairs     speeds = qd
    share = [max(-1.0, min(1.0, speed / still)) for speed, still in zip(speeds, STILL)]
%bent     share = [math.tanh(speed / v) if v else each for speed, v, each in zip(speeds, BENT, share)]
%dahl     if slip is not None:
%dahl         share = [mine if over else each for mine, over, each in zip(slip, PRESLIDING, share)]
    dry = list(COULOMB)
%root     dry = [each + root * math.sqrt(abs(speed)) for each, root, speed in zip(dry, ROOT, speeds)]
%load     for i, load in enumerate(LOAD):
%load         dry[i] += load * abs(torques[i])
    friction = [damping * v + part * whole for damping, v, part, whole in zip(DAMPING, speeds, share, dry)]
    torques = [rigid + each for rigid, each in zip(torques, friction)]
%offset     torques = [each + offset for each, offset in zip(torques, OFFSET)]
%spring     torques = [each + spring * turned for each, spring, turned in zip(torques, SPRING, q)]
%pairs     for (i, j), rotor, each in zip(COUPLED, COUPLED_ROTOR, friction[len(MASS) :]):
%pairs         together = rotor * (qdd[i] + qdd[j]) + each
%pairs         torques[i] += together
%pairs         torques[j] += together
    return torques


%dahl def slide(slip, dq):
%!pairs %dahl     """The share of its dry friction, -1 to 1, of each joint once they moved by dq, in rad (m).
%pairs %dahl     """The share of its dry friction, -1 to 1, of each joint and pair of COUPLED once joints moved by dq.
%dahl
%dahl     slip is that before, None at first. What has no pre-sliding keeps its own, which is not used.
%dahl     """
%!pairs %dahl     moved = list(dq)
%pairs %dahl     moved = list(dq) + [dq[i] + dq[j] for i, j in COUPLED]
%dahl     slip = [0.0] * len(moved) if slip is None else slip
%dahl     after = []
%dahl     for share, step, over in zip(slip, moved, PRESLIDING):
%dahl         end = math.copysign(1.0, step)
%dahl         after.append(end + (share - end) * math.exp(-abs(step) / over) if over else share)
%dahl     return after
%dahl
%dahl
def mass_matrix(q):
    """The mass matrix, in kg m^2 (kg m and kg of slides), a list of rows, at joint coordinates q in rad (m)."""
    n = len(MASS)
    units = [[float(i == j) for j in range(n)] for i in range(n)]
%!pairs     return [_rigid(q, [0.0] * n, unit, [0.0] * 3) for unit in units]
%pairs     matrix = [_rigid(q, [0.0] * n, unit, [0.0] * 3) for unit in units]
%pairs     for pair, rotor in zip(COUPLED, COUPLED_ROTOR):
%pairs         for i in pair:
%pairs             for j in pair:
%pairs                 matrix[i][j] += rotor
%pairs     return matrix


def _rigid(q, qd, qdd, gravity):
    """The joint torques without friction that give the joints accelerations qdd, in rad/s^2 (m/s^2)."""
    n = len(MASS)
    spin, spin_rate, rate = [0.0] * 3, [0.0] * 3, [-each for each in gravity]
    axes, origins, forces, moments = [], [], [], []
    for i in range(n):
        turned, origin = _place(i, q[i])
        axes.append(turned)
        origins.append(origin)
        rate = _add(rate, _cross(spin_rate, origin), _cross(spin, _cross(spin, origin)))
        spin, spin_rate, rate = _back(turned, spin), _back(turned, spin_rate), _back(turned, rate)
        own, gained = [qd[i] * each for each in AXIS[i]], [qdd[i] * each for each in AXIS[i]]
        if SLIDES[i]:
            rate = _add(rate, gained, [2.0 * each for each in _cross(spin, own)])
        else:
            spin_rate = _add(spin_rate, gained, _cross(spin, own))
            spin = _add(spin, own)
        moment, turning = MOMENT[i], _forth(INERTIA[i], spin)
        force = _add([MASS[i] * each for each in rate], _cross(spin_rate, moment), _cross(spin, _cross(spin, moment)))
        forces.append(force)
        moments.append(_add(_forth(INERTIA[i], spin_rate), _cross(spin, turning), _cross(moment, rate)))
    torques, force, moment = [0.0] * n, [0.0] * 3, [0.0] * 3
    for i in range(n - 1, -1, -1):
        force, moment = _add(force, forces[i]), _add(moment, moments[i])
        torques[i] = ROTOR[i] * qdd[i] + sum(a * b for a, b in zip(AXIS[i], force if SLIDES[i] else moment))
        force = _forth(axes[i], force)
        moment = _add(_forth(axes[i], moment), _cross(origins[i], force))
    return torques


def _place(i, q):
    """Axes of the frame of a joint at q, as columns, and its origin, in the frame before."""
    rotation, axis = ROTATION[i], AXIS[i]
    if SLIDES[i]:
        return rotation, _add(POSITION[i], [q * each for each in _forth(rotation, axis)])
    sine, versine = math.sin(q), 1.0 - math.cos(q)
    columns = []
    for unit in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]):
        across = _cross(axis, unit)
        turned = _add(unit, [sine * each for each in across], [versine * each for each in _cross(axis, across)])
        columns.append(_forth(rotation, turned))
    return [list(row) for row in zip(*columns)], POSITION[i]


def _add(*vectors):
    return [sum(each) for each in zip(*vectors)]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _forth(matrix, vector):
    return [sum(a * b for a, b in zip(row, vector)) for row in matrix]


def _back(matrix, vector):
    return _forth(list(zip(*matrix)), vector)
'''
