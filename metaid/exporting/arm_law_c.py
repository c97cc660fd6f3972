"""What the source text of an arm's law in C is filled into. A word after a dollar sign is a constant of the
model. A line after %word is left out where the model has no such thing, one after %!word where it has; %dahl is
pre-sliding, %pairs are coupled motors.
"""

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
static inline void ${name}_rigid(const double q[], const double qd[], const double qdd[], const double gravity[3],
                                 double torque[])
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

/* The joint torques, in N m (of a slide in N), that give the joints accelerations qdd, in rad/s^2 (m/s^2). q are joint
   coordinates in rad (m), qd joint speeds in rad/s (m/s). $njoint of each. */
%dahl /* slip, $nmotor numbers that ${name}_slide keeps, is the share of its dry friction that each joint has, or NULL:
%dahl    then the speeds say it. */
static inline void ${name}_inverse_dynamics(const double q[], const double qd[], const double qdd[],
%!dahl                                             double torque[])
%dahl                                             const double slip[], double torque[])
{
%!pairs     enum { N = $njoint, M = N };
%pairs     enum { N = $njoint, M = $nmotor };
    /* in the frame of the base, in m/s^2 */
    static const double gravity[3] = $gravity;
%pairs     /* pairs of joints, from 0 on, each with a motor that turns with the sum of both */
%pairs     static const int coupled[M - N][2] = $coupled;
%pairs     /* of each such motor, in kg m^2 */
%pairs     static const double coupled_rotor[M - N] = $coupled_rotor;
%!pairs     /* of each joint, in N m s and N m */
%pairs     /* of each joint, then of each such motor, in N m s and N m */
    static const double damping[M] = $damping;
    static const double coulomb[M] = $coulomb;
    /* in rad/s: what is slower has that share of its dry friction */
    static const double still[M] = $still;
%bent     /* in rad/s: where it is above 0 tanh(speed / bent) is the share */
%bent     static const double bent[M] = $bent;
%root     /* dry friction for a unit of the root of the speed, in N m s^0.5 */
%root     static const double root[M] = $root;
%dahl     /* displacement over which dry friction builds up, in rad; where it is 0 still counts */
%dahl     static const double presliding[M] = $presliding;
%load     /* of each joint: dry friction as a share of the size of the torque of bodies and rotors */
%load     static const double load[N] = $load;
%offset     /* of each joint, in N m: torque that is always there */
%offset     static const double offset[N] = $offset;
%spring     /* of each joint, in N m/rad: torque that grows with q */
%spring     static const double spring[N] = $spring;
    double friction[M];
    int i;

    ${name}_rigid(q, qd, qdd, gravity, torque);
    for (i = 0; i < M; i++) {
%!pairs         const double speed = qd[i];
%pairs         const double speed = i < N ? qd[i] : qd[coupled[i - N][0]] + qd[coupled[i - N][1]];
        double share = fmax(-1.0, fmin(1.0, speed / still[i])), dry = coulomb[i];

%bent         if (bent[i] > 0.0)
%bent             share = tanh(speed / bent[i]);
%dahl         if (slip && presliding[i] > 0.0)
%dahl             share = slip[i];
%root         dry += root[i] * sqrt(fabs(speed));
%load         if (i < N)
%load             dry += load[i] * fabs(torque[i]);
        friction[i] = damping[i] * speed + share * dry;
    }
    for (i = 0; i < N; i++) {
        torque[i] += friction[i];
%offset         torque[i] += offset[i];
%spring         torque[i] += spring[i] * q[i];
    }
%pairs     for (i = N; i < M; i++) {
%pairs         const int first = coupled[i - N][0], second = coupled[i - N][1];
%pairs         const double together = coupled_rotor[i - N] * (qdd[first] + qdd[second]) + friction[i];
%pairs
%pairs         torque[first] += together;
%pairs         torque[second] += together;
%pairs     }
}

%dahl /* Lets slip, the share of its dry friction, -1 to 1, that each joint has, follow a displacement dq of the $njoint
%dahl    joints, in rad (m). It is $nmotor numbers, all 0 at first. */
%dahl static inline void ${name}_slide(const double dq[], double slip[])
%dahl {
%!pairs %dahl     enum { N = $njoint, M = N };
%pairs %dahl     enum { N = $njoint, M = $nmotor };
%pairs %dahl     static const int coupled[M - N][2] = $coupled;
%dahl     static const double presliding[M] = $presliding;
%dahl     int i;
%dahl
%dahl     for (i = 0; i < M; i++) {
%!pairs %dahl         const double moved = dq[i], end = moved < 0.0 ? -1.0 : 1.0;
%pairs %dahl         const double moved = i < N ? dq[i] : dq[coupled[i - N][0]] + dq[coupled[i - N][1]];
%pairs %dahl         const double end = moved < 0.0 ? -1.0 : 1.0;
%dahl
%dahl         if (presliding[i] > 0.0)
%dahl             slip[i] = end + (slip[i] - end) * exp(-fabs(moved) / presliding[i]);
%dahl     }
%dahl }
%dahl
/* The joint torques, in N m (of a slide in N), that leave nothing to accelerate the arm. q are joint coordinates in
   rad (m), qd joint speeds in rad/s (m/s). $njoint of each. */
static inline void ${name}_torque(const double q[], const double qd[], double torque[])
{
    const double steady[$njoint] = {0.0};

%!dahl     ${name}_inverse_dynamics(q, qd, steady, torque);
%dahl     ${name}_inverse_dynamics(q, qd, steady, 0, torque);
}

/* The mass matrix, in kg m^2 (kg m and kg of slides), at joint coordinates q in rad (m). */
static inline void ${name}_mass_matrix(const double q[], double matrix[$njoint][$njoint])
{
    enum { N = $njoint };
    static const double weightless[3] = {0.0, 0.0, 0.0};
%pairs     static const int coupled[$nmotor - N][2] = $coupled;
%pairs     static const double coupled_rotor[$nmotor - N] = $coupled_rotor;
    const double still[N] = {0.0};
    int i, j;

    for (i = 0; i < N; i++) {
        double unit[N];

        for (j = 0; j < N; j++)
            unit[j] = i == j ? 1.0 : 0.0;
        ${name}_rigid(q, still, unit, weightless, matrix[i]);
    }
%pairs     for (i = 0; i < $nmotor - N; i++)
%pairs         for (j = 0; j < 2; j++) {
%pairs             matrix[coupled[i][j]][coupled[i][0]] += coupled_rotor[i];
%pairs             matrix[coupled[i][j]][coupled[i][1]] += coupled_rotor[i];
%pairs         }
}

#endif
"""
