/* The crawler as a chain in a plane: point masses, springs along and across, couples of magnets, ground and feet.

   Written apart from the package, of which it uses nothing: no triangles, no fold angles, other damping along the
   chain, a symplectic Euler step that takes the losses of hinges and cells with the velocity at its end (else steps
   shrink with the fourth power of the cells). See planar_crawler.py. Lengths in m, angles counted from x to z. */

#include <math.h>
#include <string.h>

#define MOST 512
#define POINTS 16
#define SHAPES 64
#define LIFTED 32
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
    int shapes, lifted;                           /* in which the strip curves across, amplitudes c [m]; of these the
                                                     first lift the bridge; none: plane strain */
    double bending[SHAPES][SHAPES];               /* energy c' bending c / 2 [N/m] */
    double poisson[MOST][SHAPES];                 /* by hinge that turns by t: t poisson . c [N] */
    double bending_loss[SHAPES][SHAPES], poisson_loss[MOST][SHAPES]; /* of what loses, times the time of that */
    double flattening[MOST][LIFTED][LIFTED];      /* membrane: sum of t^2 c' flattening c / 2 [N/m] */
    double relief[MOST][LIFTED][STRETCHES];       /* less |sum of t relief' c|^2 / 2, by moving within itself [(N/m)^1/2] */
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
static inline void solve(int n, int band, double a[n][band], double *b)
{
    for (int i = 0; i < n; i++) {
        const int first = i < band - 1 ? 0 : i - band + 1;
        for (int j = first; j <= i; j++) {
            double s = a[i][j - i + band - 1];
            for (int k = j < band ? first : (first > j - band + 1 ? first : j - band + 1); k < j; k++)
                s -= a[i][k - i + band - 1] * a[j][k - j + band - 1];
            a[i][j - i + band - 1] = j < i ? s * a[j][band - 1] : 1 / sqrt(s); /* the diagonal's inverse is kept */
        }
        double s = b[i];
        for (int k = first; k < i; k++) s -= a[i][k - i + band - 1] * b[k];
        b[i] = s * a[i][band - 1];
    }
    for (int i = n - 1; i >= 0; i--) {
        double s = b[i];
        for (int k = i + 1; k < n && k < i + band; k++) s -= a[k][i - k + band - 1] * b[k];
        b[i] = s * a[i][band - 1];
    }
}

/* curvature across the strip, without inertia: amplitudes, what the branches have followed and what they hold; the same
   of the couples that it makes of hinges */
typedef struct { double c[SHAPES], past[SHAPES], lost[SHAPES], turned[MOST], held[MOST]; } Across;

/* adds to the couples m of the hinges, which have turned by t, what the strip's curvature across makes of them; its
   bending loses like that along, by branches of which `kept` is left after a step and `gain` comes of what is new */
static void curve(const Device *d, Across *w, const double *t, double *m, double kept, double gain)
{
    const int n = d->shapes, h = d->lifted;
    double a[SHAPES][SHAPES], flat[LIFTED][LIFTED] = {{0}}, in[LIFTED][STRETCHES] = {{0}}, moved[STRETCHES] = {0};
    double load[SHAPES] = {0}, fast[SHAPES] = {0};
    for (int i = 1; i < d->cells; i++)
        for (int k = 0; k < n; k++) {
            load[k] += d->poisson[i][k] * t[i];
            fast[k] += d->poisson_loss[i][k] * t[i];
        }
    for (int i = d->first; i <= d->last; i++)
        for (int k = 0; k < h; k++) {
            for (int l = 0; l < h; l++) flat[k][l] += t[i] * t[i] * d->flattening[i][k][l];
            for (int s = 0; s < STRETCHES; s++) in[k][s] += t[i] * d->relief[i][k][s];
        }
    for (int k = 0; k < n; k++) {
        double *row = a[k] + SHAPES - 1 - k;
        w->c[k] = gain * w->past[k] - kept * w->lost[k] - load[k] - gain * fast[k];
        for (int l = 0; l <= k; l++) row[l] = d->bending[k][l] + gain * d->bending_loss[k][l];
        for (int l = 0; l <= k && k < h; l++) {
            row[l] += flat[k][l];
            for (int s = 0; s < STRETCHES; s++) row[l] -= in[k][s] * in[l][s];
        }
    }
    solve(n, SHAPES, a, w->c);
    for (int k = 0; k < n; k++) {
        for (int l = 0; l < n; l++) fast[k] += d->bending_loss[k][l] * w->c[l];
        w->lost[k] = kept * w->lost[k] + gain * (fast[k] - w->past[k]);
        w->past[k] = fast[k];
        for (int s = 0; s < STRETCHES && k < h; s++) moved[s] += in[k][s] * w->c[k];
    }
    for (int i = 1; i < d->cells; i++) {
        double turned = 0;
        for (int k = 0; k < n; k++) {
            m[i] += d->poisson[i][k] * w->c[k];
            turned += d->poisson_loss[i][k] * w->c[k];
        }
        w->held[i] = kept * w->held[i] + gain * (turned - w->turned[i]);
        w->turned[i] = turned;
        m[i] += w->held[i];
    }
    for (int i = d->first; i <= d->last; i++)
        for (int k = 0; k < h; k++) {
            for (int l = 0; l < h; l++) m[i] += t[i] * w->c[k] * d->flattening[i][k][l] * w->c[l];
            for (int s = 0; s < STRETCHES; s++) m[i] -= w->c[k] * d->relief[i][k][s] * moved[s];
        }
}

/* runs so many steps and stores the centre of mass [x] at the end of each period of `every` steps */
int run(const Device *d, double *state, double dt, long steps, long every, double *out)
{
    static _Thread_local V f[MOST];
    static _Thread_local double ux[MOST], uz[MOST], len[MOST], c[MOST], bristle[POINTS * MOST], ends[2], a[2 * MOST][BAND];
    static _Thread_local double before[MOST], lost[MOST], m[MOST];
    static _Thread_local Across w;
    const int n = d->cells;
    V *p = (V *)state, *v = p + n + 1;
    double total = 0;
    memset(bristle, 0, sizeof bristle);
    ends[0] = ends[1] = 0;
    memset(before, 0, sizeof before);
    memset(lost, 0, sizeof lost);
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
        if (d->shapes) curve(d, &w, before, m, kept, (1 - kept) / dt);
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
        solve(2 * (n + 1), BAND, a, (double *)v);
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
