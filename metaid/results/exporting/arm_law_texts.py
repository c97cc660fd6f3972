"""What the source texts of an arm's law are filled into. A word after a dollar sign is a constant of the model."""

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
DAMPING = $damping  # of each joint, in N m s (N s/m)
COULOMB = $coulomb  # of each joint, in N m (N)
SLIDING = $sliding  # rad/s (m/s): a slower joint is sent that share of its dry friction


def torque(q, qd):
    """The joint torques, in N m (of a slide in N), that leave nothing to accelerate the arm.

    q are joint coordinates in rad (m), qd joint speeds in rad/s (m/s).
    """
    bias = _inverse_dynamics(q, qd, [0.0] * len(MASS), GRAVITY)
    sliding = [max(-1.0, min(1.0, each / SLIDING)) for each in qd]
    return [bias[i] + DAMPING[i] * qd[i] + COULOMB[i] * sliding[i] for i in range(len(MASS))]


def mass_matrix(q):
    """The mass matrix, in kg m^2 (kg m and kg of slides), a list of rows, at joint coordinates q in rad (m)."""
    n = len(MASS)
    units = [[float(i == j) for j in range(n)] for i in range(n)]
    return [_inverse_dynamics(q, [0.0] * n, unit, [0.0] * 3) for unit in units]


def _inverse_dynamics(q, qd, qdd, gravity):
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

ARM_C = """
#ifndef $guard
#define $guard

#include <math.h>

/* out += a x b */
static inline void ${name}_add_cross(const double a[3], const double b[3], double out[3])
{
    out[0] += a[1] * b[2] - a[2] * b[1];
    out[1] += a[2] * b[0] - a[0] * b[2];
    out[2] += a[0] * b[1] - a[1] * b[0];
}

/* out += matrix times vector */
static inline void ${name}_add_product(const double matrix[3][3], const double vector[3], double out[3])
{
    int i;

    for (i = 0; i < 3; i++)
        out[i] += matrix[i][0] * vector[0] + matrix[i][1] * vector[1] + matrix[i][2] * vector[2];
}

/* vector becomes transposed matrix times vector */
static inline void ${name}_turn_back(const double matrix[3][3], double vector[3])
{
    double before[3];
    int i;

    for (i = 0; i < 3; i++)
        before[i] = vector[i];
    for (i = 0; i < 3; i++)
        vector[i] = matrix[0][i] * before[0] + matrix[1][i] * before[1] + matrix[2][i] * before[2];
}

/* The joint torques without friction, in N m (of a slide in N), that give the joints accelerations qdd, in rad/s^2
   (m/s^2), in a gravity in the frame of the base, in m/s^2. q are joint coordinates in rad (m), qd joint speeds in
   rad/s (m/s). $njoint of each. */
static inline void ${name}_inverse_dynamics(const double q[], const double qd[], const double qdd[],
                                            const double gravity[3], double torque[])
{
    enum { N = $njoint };
    /* of each joint: origin of its frame in the frame before, in m; axes of its frame at q = 0 (the columns); its
       axis; 1 of a slide */
    static const double position[N][3] = $position;
    static const double rotation[N][3][3] = $rotation;
    static const double axis[N][3] = $axis;
    static const int slides[N] = $slides;
    /* of each link, about the origin of its frame: mass in kg, first moment in kg m, moments of inertia in kg m^2 */
    static const double mass[N] = $mass;
    static const double moment[N][3] = $moment;
    static const double inertia[N][3][3] = $inertia;
    /* of each joint, in kg m^2 (kg): what turns with its motor */
    static const double rotor[N] = $rotor;
    double axes[N][3][3], origins[N][3], forces[N][3], moments[N][3];
    double spin[3] = {0.0, 0.0, 0.0}, spin_rate[3] = {0.0, 0.0, 0.0};
    double rate[3] = {-gravity[0], -gravity[1], -gravity[2]};
    double force[3] = {0.0, 0.0, 0.0}, load[3] = {0.0, 0.0, 0.0};
    int i, j, k;

    for (i = 0; i < N; i++) {
        const double sine = slides[i] ? 0.0 : sin(q[i]), versine = slides[i] ? 0.0 : 1.0 - cos(q[i]);
        double own[3], gained[3], around[3] = {0.0, 0.0, 0.0}, turning[3] = {0.0, 0.0, 0.0};

        for (k = 0; k < 3; k++) {
            double unit[3] = {0.0, 0.0, 0.0}, across[3] = {0.0, 0.0, 0.0}, twice[3] = {0.0, 0.0, 0.0};
            double column[3] = {0.0, 0.0, 0.0};

            unit[k] = 1.0;
            ${name}_add_cross(axis[i], unit, across);
            ${name}_add_cross(axis[i], across, twice);
            for (j = 0; j < 3; j++)
                unit[j] += sine * across[j] + versine * twice[j];
            ${name}_add_product(rotation[i], unit, column);
            for (j = 0; j < 3; j++)
                axes[i][j][k] = column[j];
        }
        for (k = 0; k < 3; k++) {
            origins[i][k] = position[i][k];
            own[k] = axis[i][k] * q[i];
        }
        if (slides[i])
            ${name}_add_product(rotation[i], own, origins[i]);
        ${name}_add_cross(spin, origins[i], around);
        ${name}_add_cross(spin, around, rate);
        ${name}_add_cross(spin_rate, origins[i], rate);
        ${name}_turn_back((const double(*)[3])axes[i], spin);
        ${name}_turn_back((const double(*)[3])axes[i], spin_rate);
        ${name}_turn_back((const double(*)[3])axes[i], rate);
        for (k = 0; k < 3; k++) {
            own[k] = axis[i][k] * qd[i] * (slides[i] ? 2.0 : 1.0);
            gained[k] = axis[i][k] * qdd[i];
        }
        ${name}_add_cross(spin, own, slides[i] ? rate : spin_rate);
        for (k = 0; k < 3; k++) {
            rate[k] += slides[i] ? gained[k] : 0.0;
            spin_rate[k] += slides[i] ? 0.0 : gained[k];
            spin[k] += slides[i] ? 0.0 : own[k];
            around[k] = moments[i][k] = 0.0;
        }
        for (k = 0; k < 3; k++)
            forces[i][k] = mass[i] * rate[k];
        ${name}_add_cross(spin, moment[i], around);
        ${name}_add_cross(spin, around, forces[i]);
        ${name}_add_cross(spin_rate, moment[i], forces[i]);
        ${name}_add_product(inertia[i], spin, turning);
        ${name}_add_product(inertia[i], spin_rate, moments[i]);
        ${name}_add_cross(spin, turning, moments[i]);
        ${name}_add_cross(moment[i], rate, moments[i]);
    }
    for (i = N - 1; i >= 0; i--) {
        double push[3] = {0.0, 0.0, 0.0}, turn[3] = {0.0, 0.0, 0.0};

        for (k = 0; k < 3; k++) {
            force[k] += forces[i][k];
            load[k] += moments[i][k];
        }
        torque[i] = rotor[i] * qdd[i];
        for (k = 0; k < 3; k++)
            torque[i] += axis[i][k] * (slides[i] ? force[k] : load[k]);
        ${name}_add_product((const double(*)[3])axes[i], force, push);
        ${name}_add_product((const double(*)[3])axes[i], load, turn);
        ${name}_add_cross(origins[i], push, turn);
        for (k = 0; k < 3; k++) {
            force[k] = push[k];
            load[k] = turn[k];
        }
    }
}

/* The joint torques, in N m (of a slide in N), that leave nothing to accelerate the arm. q are joint coordinates in
   rad (m), qd joint speeds in rad/s (m/s). $njoint of each. */
static inline void ${name}_torque(const double q[], const double qd[], double torque[])
{
    enum { N = $njoint };
    /* in the frame of the base, in m/s^2 */
    static const double gravity[3] = $gravity;
    /* of each joint, in N m s and N m; a joint slower than sliding, in rad/s, is sent that share of its dry friction */
    static const double damping[N] = $damping;
    static const double coulomb[N] = $coulomb;
    static const double sliding = $sliding;
    const double still[N] = {0.0};
    int i;

    ${name}_inverse_dynamics(q, qd, still, gravity, torque);
    for (i = 0; i < N; i++)
        torque[i] += damping[i] * qd[i] + coulomb[i] * fmax(-1.0, fmin(1.0, qd[i] / sliding));
}

/* The mass matrix, in kg m^2 (kg m and kg of slides), at joint coordinates q in rad (m). */
static inline void ${name}_mass_matrix(const double q[], double matrix[$njoint][$njoint])
{
    enum { N = $njoint };
    static const double weightless[3] = {0.0, 0.0, 0.0};
    const double still[N] = {0.0};
    int i, j;

    for (i = 0; i < N; i++) {
        double unit[N];

        for (j = 0; j < N; j++)
            unit[j] = i == j ? 1.0 : 0.0;
        ${name}_inverse_dynamics(q, still, unit, weightless, matrix[i]);
    }
}

#endif
"""
