"""What the source texts of a chain's law are filled into. A word after a dollar sign is a constant of the model; a line
that begins with %word is kept where the model has that, one with %!word where it has not.
"""

CHAIN_PYTHON = '''
import math

GRAVITY = $gravity  # of each link, in N m: the weight's moment with the link horizontal
CORIOLIS = $coriolis  # of each two links, in kg m^2
DAMPING = $damping  # of each joint, in N m s
COULOMB = $coulomb  # of each joint, in N m
SLIDING = $sliding  # rad/s: a slower joint is sent that share of its dry friction


def torque(q, qd):
    """The joint torques, in N m, that leave nothing to accelerate the pendulum.

    q are joint angles in rad, each relative to the link before, 0 upright; qd are joint speeds in rad/s.
    """
    n = len(GRAVITY)
    angle, speed = [sum(q[: i + 1]) for i in range(n)], [sum(qd[: i + 1]) for i in range(n)]
    torques, above = [0.0] * n, 0.0
    for i in range(n - 1, -1, -1):
        above -= GRAVITY[i] * math.sin(angle[i])
        for j in range(n):
            above += CORIOLIS[i][j] * math.sin(angle[i] - angle[j]) * speed[j] ** 2
        friction = DAMPING[i] * qd[i] + COULOMB[i] * max(-1.0, min(1.0, qd[i] / SLIDING))
        torques[i] = above + friction
    return torques
'''

CHAIN_MASS_MATRIX_PYTHON = '''
INERTIA = $inertia  # of each link, in kg m^2: the diagonal of the mass matrix in absolute angles
%rotor ROTOR = $rotor  # of each joint, in kg m^2: what turns with its motor


def mass_matrix(q):
    """The mass matrix in joint coordinates, in kg m^2, a list of rows, at joint angles q in rad."""
    n = len(INERTIA)
    angle = [sum(q[: i + 1]) for i in range(n)]
    links = [
        [INERTIA[i] if i == j else CORIOLIS[i][j] * math.cos(angle[i] - angle[j]) for j in range(n)] for i in range(n)
    ]
%!rotor     return [[sum(sum(row[j:]) for row in links[i:]) for j in range(n)] for i in range(n)]
%rotor     joints = [[sum(sum(row[j:]) for row in links[i:]) for j in range(n)] for i in range(n)]
%rotor     return [[joints[i][j] + (ROTOR[i] if i == j else 0.0) for j in range(n)] for i in range(n)]


def inverse_dynamics(q, qd, qdd):
    """The joint torques, in N m, that give the joints accelerations qdd, in rad/s^2.

    q, qd and qdd are each of one state, or rows of states; so are the torques.
    """
    if hasattr(q[0], "__len__"):
        return [inverse_dynamics(*state) for state in zip(q, qd, qdd)]
    q, qd, qdd = ([float(each) for each in values] for values in (q, qd, qdd))
    gained = [sum(a * b for a, b in zip(row, qdd)) for row in mass_matrix(q)]
    return [a + b for a, b in zip(torque(q, qd), gained)]
'''

CHAIN_C = """
#ifndef $guard
#define $guard

#include <math.h>

/* The joint torques, in N m, that leave nothing to accelerate the pendulum. q are joint angles in rad, each relative to
   the link before, 0 upright; qd are joint speeds in rad/s. $njoint of each. */
static inline void ${name}_torque(const double q[], const double qd[], double torque[])
{
    enum { N = $njoint };
    /* of each link, in N m: the weight's moment with the link horizontal */
    static const double gravity[N] = $gravity;
    /* of each two links, in kg m^2 */
    static const double coriolis[N][N] = $coriolis;
    /* of each joint, in N m s and N m; a joint slower than sliding, in rad/s, is sent that share of its dry friction */
    static const double damping[N] = $damping;
    static const double coulomb[N] = $coulomb;
    static const double sliding = $sliding;
    double angle[N], speed[N], above = 0.0;
    int i, j;

    for (i = 0; i < N; i++) {
        angle[i] = q[i] + (i > 0 ? angle[i - 1] : 0.0);
        speed[i] = qd[i] + (i > 0 ? speed[i - 1] : 0.0);
    }
    for (i = N - 1; i >= 0; i--) {
        above -= gravity[i] * sin(angle[i]);
        for (j = 0; j < N; j++)
            above += coriolis[i][j] * sin(angle[i] - angle[j]) * speed[j] * speed[j];
        torque[i] = above + damping[i] * qd[i] + coulomb[i] * fmax(-1.0, fmin(1.0, qd[i] / sliding));
    }
}
"""

CHAIN_MASS_MATRIX_C = """
/* The mass matrix in joint coordinates, in kg m^2, at joint angles q in rad. */
static inline void ${name}_mass_matrix(const double q[], double matrix[$njoint][$njoint])
{
    enum { N = $njoint };
    static const double coriolis[N][N] = $coriolis;
    /* of each link, in kg m^2: the diagonal of the mass matrix in absolute angles */
    static const double inertia[N] = $inertia;
%rotor     /* of each joint, in kg m^2: what turns with its motor */
%rotor     static const double rotor[N] = $rotor;
    double angle[N];
    int i, j, k, l;

    for (i = 0; i < N; i++)
        angle[i] = q[i] + (i > 0 ? angle[i - 1] : 0.0);
    for (i = 0; i < N; i++)
        for (j = 0; j < N; j++) {
%!rotor             matrix[i][j] = 0.0;
%rotor             matrix[i][j] = i == j ? rotor[i] : 0.0;
            for (k = i; k < N; k++)
                for (l = j; l < N; l++)
                    matrix[i][j] += k == l ? inertia[k] : coriolis[k][l] * cos(angle[k] - angle[l]);
        }
}

/* The joint torques, in N m, that give the joints accelerations qdd, in rad/s^2. */
static inline void ${name}_inverse_dynamics(const double q[], const double qd[], const double qdd[], double torque[])
{
    enum { N = $njoint };
    double matrix[N][N];
    int i, j;

    ${name}_mass_matrix(q, matrix);
    ${name}_torque(q, qd, torque);
    for (i = 0; i < N; i++)
        for (j = 0; j < N; j++)
            torque[i] += matrix[i][j] * qdd[j];
}
"""

END_C = """
#endif
"""
