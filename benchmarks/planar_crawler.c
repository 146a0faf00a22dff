/* The crawler as a chain in a plane: point masses, springs along and across, couples of magnets, ground and feet.

   Written apart from the package, of which it uses nothing: no triangles, no fold angles, other damping along the
   chain, a symplectic Euler step that takes the losses of hinges and cells with the velocity at its end (else steps
   shrink with the fourth power of the cells). See planar_crawler.py. Lengths in m, angles counted from x to z. */

#include <math.h>
#include <string.h>

#define MOST 512
#define POINTS 16
#define SHAPES 8
#define STRETCHES 16
#define BAND 6 /* a hinge joins three stations of two coordinates */

typedef struct {
    int cells;                                    /* stations are one more */
    double rigidity[MOST], loss[MOST];            /* of hinges at stations [N m, N m s]; the ends have none */
    double axial[MOST], dashpot[MOST];            /* of cells [N/m, N s/m] */
    double length[MOST], couple[MOST];            /* of cells [m], moment along the cell [A m^2] */
    double lift[MOST];                            /* of cells: weight times its height above the line [N m] */
    double mass[MOST];                            /* of stations [kg] */
    double kn[MOST], cn[MOST];                    /* of cells: ground below them [N/m, N s/m] */
    double foot_kn, foot_cn;                      /* of the feet, one at either end */
    int points;                                   /* that stand for the ground below a cell (Gauss) */
    double at[POINTS], share[POINTS];             /* where they are along it, 0 to 1; they sum to 1 */
    double belly, foot;                           /* depths below the line [m] */
    double mu, mu_forward, mu_back;               /* friction of the belly, of the feet */
    double field, frequency, gravity, decay;
    double relaxation;                            /* of the losses' Maxwell branch [s]; 0: they are viscous */
    int first, last;                              /* stations between which the bridge is */
    int shapes;                                   /* in which a bridge curves across, amplitudes c [m]; 0: plane strain */
    double bending[SHAPES][SHAPES];               /* energy c' bending c / 2 [N/m] */
    double poisson[MOST][SHAPES];                 /* by hinge that turns by t: t poisson . c [N] */
    double flattening[MOST][SHAPES][SHAPES];      /* membrane: sum of t^2 c' flattening c / 2 [N/m] */
    double relief[MOST][SHAPES][STRETCHES];       /* less |sum of t relief' c|^2 / 2, by moving within itself [(N/m)^1/2] */
    double loss_time;                             /* of the bridge's bending across [s] */
} Device;

typedef struct { double x, z; } V;

/* adds dt c g g^T for a rate that is g . v over k coordinates from `first` */
static void lose(double (*a)[BAND], int first, int k, const double *g, double c)
{
    for (int i = 0; i < k; i++)
        for (int j = 0; j <= i; j++) a[first + i][j - i + BAND - 1] += c * g[i] * g[j];
}

/* one contact of cell j at its share t, o along the cell's normal below the line; adds its force, updates its bristle;
   what its dashpots add to the system goes into the matrix */
static void touch(const V *p, const V *v, V *f, double (*matrix)[BAND], int j, double t, double o, double length,
                  double kn, double cn, double mu_forward, double mu_back, double dt, double *bristle)
{
    const int a = j, b = j + 1;
    const double ux = (p[b].x - p[a].x) / length, uz = (p[b].z - p[a].z) / length;
    const double gap = (1 - t) * p[a].z + t * p[b].z - o * ux;           /* the normal is (-uz, ux) */
    if (gap >= 0) { *bristle = 0; return; }
    const double turn = (ux * (v[b].z - v[a].z) - uz * (v[b].x - v[a].x)) / length;
    const double vx = (1 - t) * v[a].x + t * v[b].x + o * ux * turn;
    const double vz = (1 - t) * v[a].z + t * v[b].z + o * uz * turn;
    double load = -kn * gap - cn * vz;
    if (load <= 0) { *bristle = 0; return; }
    double s = *bristle + vx * dt, pull = -kn * s - cn * vx;
    /* it slides, or is about to, against the pull; the body's forward direction is that of u along the ground */
    const double along = (pull > 0 ? -1.0 : 1.0) * (ux > 0 ? 1.0 : -1.0);
    const double limit = load * (along > 0 ? mu_forward : mu_back);
    const double side = 1 - t, r = o / length;
    const double up[4] = {r * uz * uz, side - r * uz * ux, -r * uz * uz, 1 - side + r * uz * ux};
    const double on[4] = {side + r * ux * uz, -r * ux * ux, 1 - side - r * ux * uz, r * ux * ux};
    load += cn * vz; /* the dashpots act with the velocity at the end of the step */
    lose(matrix, 2 * a, 4, up, dt * cn);
    if (fabs(pull) > limit) {
        pull = pull > 0 ? limit : -limit;
        s = -pull / kn;
    } else {
        pull += cn * vx;
        lose(matrix, 2 * a, 4, on, dt * cn);
    }
    *bristle = s;
    const double c = o * (ux * pull + uz * load) / length;
    f[a].x += side * pull + c * uz; f[a].z += side * load - c * ux;
    f[b].x += t * pull - c * uz; f[b].z += t * load + c * ux;
}

/* solves a x = b by Cholesky's decomposition; a holds the lower band, row by row, its diagonal last; x goes into b */
static void solve(int n, double (*a)[BAND], double *b)
{
    for (int i = 0; i < n; i++) {
        const int first = i < BAND - 1 ? 0 : i - BAND + 1;
        for (int j = first; j <= i; j++) {
            double s = a[i][j - i + BAND - 1];
            for (int k = j < BAND ? first : (first > j - BAND + 1 ? first : j - BAND + 1); k < j; k++)
                s -= a[i][k - i + BAND - 1] * a[j][k - j + BAND - 1];
            a[i][j - i + BAND - 1] = j < i ? s * a[j][BAND - 1] : 1 / sqrt(s); /* the diagonal's inverse is kept */
        }
        double s = b[i];
        for (int k = first; k < i; k++) s -= a[i][k - i + BAND - 1] * b[k];
        b[i] = s * a[i][BAND - 1];
    }
    for (int i = n - 1; i >= 0; i--) {
        double s = b[i];
        for (int k = i + 1; k < n && k < i + BAND; k++) s -= a[k][i - k + BAND - 1] * b[k];
        b[i] = s * a[i][BAND - 1];
    }
}

/* curvature across the bridge, without inertia */
typedef struct { double c[SHAPES], stress[SHAPES], lost[SHAPES]; } Across;

/* adds to the couples m of the hinges, which have turned by t, what the bridge's curvature across makes of them; its
   bending loses like that along, by branches of which `kept` is left after a step; `drag` is their stiffness over the
   elastic one for what is new. `held` and `lost` are the couples by bending alone and by their branches. */
static void curve(const Device *d, Across *w, const double *t, double *m, double *held, double *lost, double kept,
                  double drag)
{
    const int n = d->shapes;
    double a[SHAPES][SHAPES], b[SHAPES], load[SHAPES] = {0}, in[SHAPES][STRETCHES] = {{0}}, moved[STRETCHES] = {0};
    for (int k = 0; k < n; k++)
        for (int l = 0; l < n; l++) a[k][l] = (1 + drag) * d->bending[k][l];
    for (int i = d->first; i <= d->last; i++)
        for (int k = 0; k < n; k++) {
            load[k] += d->poisson[i][k] * t[i];
            for (int l = 0; l < n; l++) a[k][l] += t[i] * t[i] * d->flattening[i][k][l];
            for (int s = 0; s < STRETCHES; s++) in[k][s] += t[i] * d->relief[i][k][s];
        }
    for (int k = 0; k < n; k++) {
        b[k] = drag * w->stress[k] - kept * w->lost[k] - (1 + drag) * load[k];
        for (int l = 0; l < n; l++)
            for (int s = 0; s < STRETCHES; s++) a[k][l] -= in[k][s] * in[l][s];
    }
    for (int k = 0; k < n; k++)
        for (int r = k + 1; r < n; r++) {
            const double q = a[r][k] / a[k][k];
            for (int l = k; l < n; l++) a[r][l] -= q * a[k][l];
            b[r] -= q * b[k];
        }
    for (int k = n - 1; k >= 0; k--) {
        for (int l = k + 1; l < n; l++) b[k] -= a[k][l] * w->c[l];
        w->c[k] = b[k] / a[k][k];
    }
    for (int k = 0; k < n; k++) {
        double stress = load[k];
        for (int l = 0; l < n; l++) stress += d->bending[k][l] * w->c[l];
        w->lost[k] = kept * w->lost[k] + drag * (stress - w->stress[k]);
        w->stress[k] = stress;
        for (int s = 0; s < STRETCHES; s++) moved[s] += in[k][s] * w->c[k];
    }
    for (int i = d->first; i <= d->last; i++) {
        double now = 0, flat = 0;
        for (int k = 0; k < n; k++) {
            now += d->poisson[i][k] * w->c[k];
            for (int l = 0; l < n; l++) flat += t[i] * w->c[k] * d->flattening[i][k][l] * w->c[l];
            for (int s = 0; s < STRETCHES; s++) flat -= w->c[k] * d->relief[i][k][s] * moved[s];
        }
        lost[i] = kept * lost[i] + drag * (now - held[i]);
        held[i] = now;
        m[i] += now + lost[i] + flat;
    }
}

/* runs so many steps and stores the centre of mass [x] at the end of each period of `every` steps */
int run(const Device *d, double *state, double dt, long steps, long every, double *out)
{
    static _Thread_local V f[MOST];
    static _Thread_local double ux[MOST], uz[MOST], len[MOST], c[MOST], bristle[POINTS * MOST], ends[2], a[2 * MOST][BAND];
    static _Thread_local double before[MOST], lost[MOST], m[MOST], held[MOST], own[MOST];
    static _Thread_local Across w;
    const int n = d->cells;
    V *p = (V *)state, *v = p + n + 1;
    double total = 0;
    memset(bristle, 0, sizeof bristle);
    ends[0] = ends[1] = 0;
    memset(before, 0, sizeof before);
    memset(lost, 0, sizeof lost);
    memset(held, 0, sizeof held);
    memset(own, 0, sizeof own);
    memset(&w, 0, sizeof w);
    const double kept = d->relaxation > 0 ? exp(-dt / d->relaxation) : 0;
    for (int i = 0; i <= n; i++) total += d->mass[i];
    for (long k = 0; k < steps; k++) {
        memset(a, 0, 2 * (n + 1) * sizeof *a);
        const double b = d->field * sin(2 * M_PI * d->frequency * k * dt);
        for (int i = 0; i <= n; i++) {
            f[i].x = -d->decay * d->mass[i] * v[i].x;
            f[i].z = -d->mass[i] * (d->gravity + d->decay * v[i].z);
        }
        for (int j = 0; j < n; j++) {
            const double dx = p[j + 1].x - p[j].x, dz = p[j + 1].z - p[j].z, l = sqrt(dx * dx + dz * dz);
            len[j] = l; ux[j] = dx / l; uz[j] = dz / l;
            const double t = d->axial[j] * (l - d->length[j]);
            f[j].x += t * ux[j]; f[j].z += t * uz[j];
            f[j + 1].x -= t * ux[j]; f[j + 1].z -= t * uz[j];
            c[j] = d->couple[j] * b * ux[j] + d->lift[j] * uz[j];
        }
        for (int i = 1; i < n; i++) {
            const double angle = atan2(ux[i - 1] * uz[i] - uz[i - 1] * ux[i], ux[i - 1] * ux[i] + uz[i - 1] * uz[i]);
            m[i] = d->rigidity[i] * angle;
            if (d->relaxation > 0) { /* exact for an even rate; the branch's stiffness times its time is the loss */
                lost[i] = kept * lost[i] + (1 - kept) / dt * d->loss[i] * (angle - before[i]);
                m[i] += lost[i];
            }
            before[i] = angle;
        }
        if (d->shapes) curve(d, &w, before, m, held, own, kept, (1 - kept) / dt * d->loss_time);
        for (int i = 1; i < n; i++) { c[i] -= m[i]; c[i - 1] += m[i]; }
        for (int j = 0; j < n; j++) {
            const double q = c[j] / len[j];
            f[j].x += q * uz[j]; f[j].z -= q * ux[j];
            f[j + 1].x -= q * uz[j]; f[j + 1].z += q * ux[j];
        }
        touch(p, v, f, a, 0, 0, d->foot, len[0], d->foot_kn, d->foot_cn, d->mu_forward, d->mu_back, dt, ends);
        touch(p, v, f, a, n - 1, 1, d->foot, len[n - 1], d->foot_kn, d->foot_cn, d->mu_forward, d->mu_back, dt, ends + 1);
        for (int j = 0; j < n; j++) {
            double *b = bristle + j * d->points;
            if (fmin(p[j].z, p[j + 1].z) > d->belly) { memset(b, 0, d->points * sizeof *b); continue; }
            for (int i = 0; i < d->points; i++)
                touch(p, v, f, a, j, d->at[i], d->belly, len[j], d->kn[j] * d->share[i], d->cn[j] * d->share[i], d->mu,
                      d->mu, dt, b + i);
        }
        double x = 0;
        for (int i = 0; i <= n; i++) {
            a[2 * i][BAND - 1] += d->mass[i]; a[2 * i + 1][BAND - 1] += d->mass[i];
            v[i].x = d->mass[i] * v[i].x + dt * f[i].x; v[i].z = d->mass[i] * v[i].z + dt * f[i].z;
        }
        for (int j = 0; j < n; j++) {
            const double g[4] = {-ux[j], -uz[j], ux[j], uz[j]};
            lose(a, 2 * j, 4, g, dt * d->dashpot[j]);
        }
        for (int i = 1; i < n && d->relaxation <= 0; i++) {
            const double hx = -uz[i - 1] / len[i - 1], hz = ux[i - 1] / len[i - 1];
            const double qx = -uz[i] / len[i], qz = ux[i] / len[i];
            const double g[6] = {hx, hz, -hx - qx, -hz - qz, qx, qz};
            lose(a, 2 * i - 2, 6, g, dt * d->loss[i]);
        }
        solve(2 * (n + 1), a, (double *)v);
        for (int i = 0; i <= n; i++) {
            p[i].x += dt * v[i].x; p[i].z += dt * v[i].z;
        }
        if ((k + 1) % every == 0) {
            for (int i = 0; i <= n; i++) x += d->mass[i] * p[i].x;
            *out++ = x / total;
            if (!isfinite(x)) return 1;
        }
    }
    return 0;
}
