/* The own ship's physics in plain C, as a ceiling for the compiled kernels: usv_gym/world/actuators.py, dynamics.py and
 * disturbance.py (calm) of one plant, with libm, doubles and a struct per ship.  benchmarks/ceiling.py compiles, checks and
 * times it.
 */
#include <math.h>

enum { THRUSTERS = 4 };

typedef struct { /* in the order of FIELDS in ceiling.py; everything a double */
    double i11, i22, i23, i32, i33, c11, c22, c23, linearised;
    double Xu, Xuu, Xuuu, Xuu_ittc, Yv, Yr, Yvv, Yrv, Yvr, Yrr, Yvvv, Nv, Nr, Nvv, Nrv, Nvr, Nrr, Nrrr;
    double cd2d, draught, x0, x1, crossflow_sway, crossflow_yaw, dead_zone, length_pp;
    double area_side, wind_arm, cd_t, cd_l_bow, cd_l_stern, wind_delta, wind_surge_factor;
    double thrusters, bucket_in_yaw;
    double x[THRUSTERS], y[THRUSTERS], direction[THRUSTERS], gain_ahead[THRUSTERS], gain_astern[THRUSTERS];
    double n_idle[THRUSTERS], n_max[THRUSTERS], n_min[THRUSTERS], nozzle_max[THRUSTERS], bucket[THRUSTERS];
    double thrust_left[THRUSTERS], nozzle_stuck[THRUSTERS], lag[THRUSTERS][3], command[THRUSTERS][3];
    double n[THRUSTERS], alpha[THRUSTERS], beta[THRUSTERS];
    double eta[3], nu[3], velocity[2];
    double memory, memory_scale[2], den[3][4], num[3][4], memory_x[4][4];
} Ship;

static double clip(double v, double low, double high) { return fmin(fmax(v, low), high); }

static void actuate(Ship *s)
{
    for (int i = 0; i < (int)s->thrusters; i++) {
        double demand = clip(s->command[i][0], -1.0, 1.0), idle = s->n_idle[i];
        double span = demand >= 0.0 ? s->n_max[i] - idle : idle - s->n_min[i];
        s->n[i] += s->lag[i][0] * (idle + demand * span - s->n[i]);
        if (s->nozzle_stuck[i] == 0.0)
            s->alpha[i] += s->lag[i][1] * (-s->nozzle_max[i] * clip(s->command[i][1], -1.0, 1.0) - s->alpha[i]);
        if (s->bucket[i] != 0.0)
            s->beta[i] += s->lag[i][2] * (clip(s->command[i][2], -1.0, 1.0) - s->beta[i]);
    }
}

static void crossflow(double v, double r, double x0, double x1, double *force, double *moment)
{
    double y0 = v + x0 * r, y1 = v + x1 * r;
    if (y0 * y1 >= 0.0) {
        double m0 = x1 - x0, m1 = 0.5 * (x1 * x1 - x0 * x0), m2 = (x1 * x1 * x1 - x0 * x0 * x0) / 3.0;
        double m3 = m1 * 0.5 * (x1 * x1 + x0 * x0), sign = y0 + y1 >= 0.0 ? 1.0 : -1.0;
        *force = sign * (v * v * m0 + r * (2.0 * v * m1 + r * m2));
        *moment = sign * (v * v * m1 + r * (2.0 * v * m2 + r * m3));
        return;
    }
    double c0 = fabs(y0 * y0 * y0), c1 = fabs(y1 * y1 * y1), third = (c1 - c0) / 3.0;
    *force = third / r;
    *moment = (0.25 * (y1 * c1 - y0 * c0) - v * third) / (r * r);
}

static void acceleration(const Ship *s, double u, double v, double r, double friction, double X, double Y, double N, double *a)
{
    double av = fabs(v), ar = fabs(r);
    X += (s->Xu + friction * fabs(u) + s->Xuuu * u * u) * u;
    Y += (s->Yv + s->Yvv * av + s->Yvvv * v * v + s->Yrv * ar) * v + (s->Yr + s->Yvr * av + s->Yrr * ar) * r;
    N += (s->Nv + s->Nvv * av + s->Nrv * ar) * v + (s->Nr + s->Nvr * av + s->Nrr * ar + s->Nrrr * r * r) * r;
    Y -= s->c11 * u * r;
    if (s->linearised == 0.0) {
        double momentum = s->c22 * v + s->c23 * r;
        X += momentum * r;
        N -= momentum * u - s->c11 * u * v;
    }
    if (av >= s->dead_zone) {
        double drag = 0.5 * 1025.0 * s->draught * s->cd2d, force, moment;
        crossflow(v, r, s->x0, s->x1, &force, &moment);
        Y -= s->crossflow_sway * drag * force;
        N -= s->crossflow_yaw * drag * moment;
    }
    a[0] = s->i11 * X;
    a[1] = s->i22 * Y + s->i23 * N;
    a[2] = s->i32 * Y + s->i33 * N;
}

static double transfer(double *x, const double *den, const double *num, double drive, double h)
{
    double g = 0.5 * h, k2 = x[1], k3 = x[2] + g * k2, k4 = x[3] + g * k3;
    double m1 = (x[0] + g * (drive - den[1] * k2 - den[2] * k3 - den[3] * k4))
                / (1.0 + g * (den[0] + g * (den[1] + g * (den[2] + g * den[3]))));
    double m2 = x[1] + g * m1, m3 = x[2] + g * m2, m4 = x[3] + g * m3;
    x[0] = 2.0 * m1 - x[0];
    x[1] = 2.0 * m2 - x[1];
    x[2] = 2.0 * m3 - x[2];
    x[3] = 2.0 * m4 - x[3];
    return num[0] * m1 + num[1] * m2 + num[2] * m3 + num[3] * m4;
}

static void step(Ship *s, double h)
{
    double u = s->nu[0], v = s->nu[1], r = s->nu[2], psi = s->eta[2], X = 0.0, Y = 0.0, N = 0.0;
    double sine = sin(psi), cosine = cos(psi);
    for (int i = 0; i < (int)s->thrusters; i++) {
        double n = s->n[i];
        if (n == 0.0)
            continue;
        double force = (n > 0.0 ? s->gain_ahead[i] : s->gain_astern[i]) * n * fabs(n) * s->thrust_left[i];
        double si = sin(s->direction[i] + s->alpha[i]), co = cos(s->direction[i] + s->alpha[i]);
        double beta = s->bucket[i] != 0.0 ? s->beta[i] : 1.0;
        X += force * beta * co;
        Y += force * beta * si;
        N += force * (s->bucket_in_yaw != 0.0 ? beta : 1.0) * (s->x[i] * si - s->y[i] * co);
    }
    double speed2 = u * u + v * v;
    if (s->area_side > 0.0 && speed2 > 0.0) { /* drag of the air, which stands still */
        double speed = sqrt(speed2), along = u / speed, across = v / speed;
        double cd_l = (u >= 0.0 ? s->cd_l_bow : s->cd_l_stern) * s->wind_surge_factor;
        double squeeze = 1.0 - 2.0 * s->wind_delta * (1.0 - cd_l / s->cd_t) * (along * across) * (along * across);
        double load = 0.5 * 1.204 * speed2 * s->area_side / squeeze, side = -load * s->cd_t * across;
        X -= load * cd_l * along;
        Y += side;
        N += side * (s->wind_arm - 0.18 * (atan2(fabs(v), u) - 0.5 * M_PI) * s->length_pp);
    }
    if (s->memory != 0.0) {
        double sway = transfer(s->memory_x[0], s->den[0], s->num[0], v, h);
        double yaw = transfer(s->memory_x[1], s->den[1], s->num[1], r, h);
        sway += transfer(s->memory_x[2], s->den[2], s->num[2], r, h);
        yaw += transfer(s->memory_x[3], s->den[2], s->num[2], v, h);
        Y -= s->memory_scale[0] * sway;
        N -= s->memory_scale[1] * yaw;
    }
    double friction = s->Xuu;
    if (s->Xuu_ittc != 0.0) {
        double decades = log(fmax(u, 0.2) * s->length_pp / 1.0e-6) / log(10.0) - 2.0;
        friction += s->Xuu_ittc * (0.075 / (decades * decades) + 0.014);
    }
    double a[3], b[3];
    acceleration(s, u, v, r, friction, X, Y, N, a);
    double u1 = u + h * a[0], v1 = v + h * a[1], r1 = r + h * a[2];
    double sine1 = sin(psi + h * r), cosine1 = cos(psi + h * r);
    acceleration(s, u1, v1, r1, friction, X, Y, N, b);
    s->eta[0] += 0.5 * h * (cosine * u - sine * v + cosine1 * u1 - sine1 * v1);
    s->eta[1] += 0.5 * h * (sine * u + cosine * v + sine1 * u1 + cosine1 * v1);
    s->eta[2] = psi += 0.5 * h * (r + r1);
    s->nu[0] = u += 0.5 * h * (a[0] + b[0]);
    s->nu[1] = v += 0.5 * h * (a[1] + b[1]);
    s->nu[2] = r + 0.5 * h * (a[2] + b[2]);
    sine = sin(psi), cosine = cos(psi);
    s->velocity[0] = cosine * u - sine * v;
    s->velocity[1] = sine * u + cosine * v;
}

void advance(Ship *ships, long count, long ticks, double h)
{
    for (long b = 0; b < count; b++)
        for (long k = 0; k < ticks; k++) {
            actuate(&ships[b]);
            step(&ships[b], h);
        }
}
