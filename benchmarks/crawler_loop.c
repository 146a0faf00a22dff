/* The rollout of benchmarks/crawler_strip.py by hand: the same laws, arithmetic and order, in plain C.
   One world: arrays of structs, the whole time loop in one call. Compiled by run.py with cc -O3 -march=native. */

#include <math.h>

typedef struct { double x, y, z; } vec;
typedef struct { vec x, v, a, f, free; double mass, gx, gy, gz; } node;
typedef struct { int p, q; double stiffness, rest; } bar;
typedef struct { int i, j, k, l; double angle, stiffness, rest, viscosity; } hinge;
typedef struct { int n1, n2, n3; double remanence, volume, a, b, c; } triangle;
typedef struct {
    int n1, n2, n3; double w1, w2, w3, off, a1, a2, a3;
    double kn, cn, mu, back, kt, ct; vec bristle;
} contact;
typedef struct { double offset, amplitude, omega, phase; } wave;
typedef struct { double crease_viscosity, magnetic, ground, friction; } exchange;
typedef struct {
    int nodes, bars, creases, hinges, triangles, contacts;
    node *node; bar *bar; hinge *hinge; triangle *triangle; contact *contact;
    wave field[3]; double tilt, azimuth, height, reach; exchange work, power; int failed_step, failed_node;
} world;

static const double MU0 = 1.25663706212e-6, TURN = 2 * 3.14159265358979323846;

static inline vec add(vec a, vec b) { return (vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vec sub(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline vec mul(double s, vec a) { return (vec){s * a.x, s * a.y, s * a.z}; }
static inline vec divide(vec a, double s) { return (vec){a.x / s, a.y / s, a.z / s}; }
static inline double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec cross(vec a, vec b) { return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static inline double norm(vec a) { return sqrt(dot(a, a)); }
static inline vec unit_or_zero(vec a) { double n = norm(a); return n > 0 ? divide(a, n) : (vec){0, 0, 0}; }
static inline double at(const wave *w, double t) {
    return w->amplitude != 0 ? w->offset + w->amplitude * sin(w->omega * t + w->phase) : w->offset;
}

typedef struct { double angle; vec gi, gj, gk, gl; } dihedral;

/* atan2 of a small angle by its series, as in the kernel */
static inline double turned(double y, double x) {
    double t = y / x, u = t * t;
    if (u < 1.0 / 1024 && x > 0) {
        double s = (u / 9 - 1.0 / 7) * u + 0.2;
        return t + t * u * (s * u - 1.0 / 3);
    }
    return atan2(y, x);
}

static inline dihedral fold(vec xi, vec xj, vec xk, vec xl) {
    dihedral h;
    vec e = sub(xk, xj), ri = sub(xi, xj), rl = sub(xl, xj), n1 = cross(ri, e), n2 = cross(e, rl);
    double ee = dot(e, e), length = sqrt(ee);
    h.angle = turned(dot(ri, n2) * length, dot(n1, n2));
    h.gi = mul(length / dot(n1, n1), n1);
    h.gl = mul(length / dot(n2, n2), n2);
    double inverse = 1 / ee, ai = dot(ri, e) * inverse, al = dot(rl, e) * inverse;
    h.gj = sub(mul(-(1 - ai), h.gi), mul(1 - al, h.gl));
    h.gk = sub(mul(-ai, h.gi), mul(al, h.gl));
    return h;
}

static inline void normal_gradients(vec x1, vec x2, vec x3, vec *n, vec *g1, vec *g2, vec *g3) {
    vec c = cross(sub(x2, x1), sub(x3, x1));
    double inverse = 1 / norm(c);
    *n = mul(inverse, c);
    *g1 = mul(inverse, cross(*n, sub(x3, x2)));
    *g2 = mul(inverse, cross(*n, sub(x1, x3)));
    *g3 = mul(inverse, cross(*n, sub(x2, x1)));
}

void run(world *w, int first_step, int steps, double dt, double speed_limit) {
    double limit = speed_limit * speed_limit;
    int start = first_step > 0 ? first_step : 0, fastest = -1;
    vec up = {-sin(w->tilt) * cos(w->azimuth), -sin(w->tilt) * sin(w->azimuth), cos(w->tilt)};
    if (w->failed_step >= 0) return;
    for (int s = first_step < 0 ? -1 : 0; s < steps; s++) {
        double h = s < 0 ? 0 : dt, half = 0.5 * h, time = dt * (start + s + 1);
        exchange power = {0, 0, 0, 0};
        for (int n = 0; n < w->nodes; n++) {
            node *p = &w->node[n];
            vec ahead = add(p->v, mul(half, p->a));
            p->x = add(p->x, mul(h, ahead));
            p->v = add(ahead, mul(half, p->a));
            p->f = (vec){0, 0, 0};
        }
        vec field = {at(&w->field[0], time), at(&w->field[1], time), at(&w->field[2], time)};
        for (int n = 0; n < w->nodes; n++) {
            node *p = &w->node[n];
            p->f = add(p->f, mul(p->mass, (vec){p->gx, p->gy, p->gz}));
        }
        for (int b = 0; b < w->bars; b++) {
            bar *e = &w->bar[b];
            node *p = &w->node[e->p], *q = &w->node[e->q];
            vec span = sub(q->x, p->x);
            double length = norm(span);
            vec pull = mul(e->stiffness * (length - e->rest), mul(1 / length, span));
            p->f = add(p->f, pull);
            q->f = sub(q->f, pull);
        }
        for (int c = 0; c < w->hinges; c++) {
            hinge *e = &w->hinge[c];
            node *i = &w->node[e->i], *j = &w->node[e->j], *k = &w->node[e->k], *l = &w->node[e->l];
            dihedral g = fold(i->x, j->x, k->x, l->x);
            double angle = g.angle;
            if (fabs(e->angle - angle) > TURN / 2) angle += TURN * round((e->angle - angle) / TURN);
            e->angle = angle;
            double moment = -e->stiffness * (angle - e->rest);
            if (c < w->creases) {
                double rate = dot(g.gi, i->v) + dot(g.gj, j->v) + dot(g.gk, k->v) + dot(g.gl, l->v);
                double loss = -e->viscosity * rate;
                power.crease_viscosity += loss * rate;
                moment += loss;
            }
            i->f = add(i->f, mul(moment, g.gi));
            j->f = add(j->f, mul(moment, g.gj));
            k->f = add(k->f, mul(moment, g.gk));
            l->f = add(l->f, mul(moment, g.gl));
        }
        for (int c = 0; c < w->triangles; c++) {
            triangle *e = &w->triangle[c];
            node *p1 = &w->node[e->n1], *p2 = &w->node[e->n2], *p3 = &w->node[e->n3];
            double m = e->remanence * e->volume / MU0;
            vec d = add(mul(e->a, sub(p2->x, p1->x)), mul(e->b, sub(p3->x, p1->x))), in_plane = {0, 0, 0};
            double length = norm(d);
            if (length > 0) {
                vec u = divide(d, length);
                double share = sqrt(fmax(1 - e->c * e->c, 0));
                in_plane = mul(m * share / length, sub(field, mul(dot(u, field), u)));
            }
            vec f2 = mul(e->a, in_plane), f3 = mul(e->b, in_plane), f1 = sub(mul(-1, f2), f3);
            if (e->c != 0) {
                vec n, g1, g2, g3;
                normal_gradients(p1->x, p2->x, p3->x, &n, &g1, &g2, &g3);
                f1 = sub(f1, mul(m * e->c * dot(field, g1), n));
                f2 = sub(f2, mul(m * e->c * dot(field, g2), n));
                f3 = sub(f3, mul(m * e->c * dot(field, g3), n));
            }
            p1->f = add(p1->f, f1);
            p2->f = add(p2->f, f2);
            p3->f = add(p3->f, f3);
            power.magnetic += dot(f1, p1->v) + dot(f2, p2->v) + dot(f3, p3->v);
        }
        for (int c = 0; c < w->contacts; c++) {
            contact *e = &w->contact[c];
            node *p1 = &w->node[e->n1], *p2 = &w->node[e->n2], *p3 = &w->node[e->n3];
            vec n, g1, g2, g3;
            vec foot = add(add(mul(e->w1, p1->x), mul(e->w2, p2->x)), mul(e->w3, p3->x));
            normal_gradients(p1->x, p2->x, p3->x, &n, &g1, &g2, &g3);
            foot = add(foot, mul(e->off, n));
            double gap = dot(up, foot) - w->height;
            if (gap < w->reach) {
                vec v = add(add(mul(e->w1, p1->v), mul(e->w2, p2->v)), mul(e->w3, p3->v));
                v = sub(v, mul(e->off, add(add(mul(dot(n, p1->v), g1), mul(dot(n, p2->v), g2)), mul(dot(n, p3->v), g3))));
                double rate = dot(up, v);
                double load = gap < 0 ? fmax(-e->kn * gap - e->cn * rate, 0) : 0;
                power.ground += load * rate;
                vec push = mul(load, up);
                v = sub(v, mul(rate, up));
                vec slip = mul(h, v);
                vec kick = add(add(mul(e->w1, p1->a), mul(e->w2, p2->a)), mul(e->w3, p3->a));
                kick = sub(kick, mul(e->off, add(add(mul(dot(n, p1->a), g1), mul(dot(n, p2->a), g2)), mul(dot(n, p3->a), g3))));
                slip = sub(slip, mul(half * h, sub(kick, mul(dot(up, kick), up))));
                vec ahead = add(add(mul(e->a1, p1->x), mul(e->a2, p2->x)), mul(e->a3, p3->x));
                vec axis = unit_or_zero(sub(ahead, mul(dot(up, ahead), up)));
                vec direction = unit_or_zero(add(e->bristle, slip));
                double coefficient = e->mu + e->back * fmax(-dot(direction, axis), 0);
                vec stretch = add(e->bristle, slip);
                stretch = sub(stretch, mul(dot(up, stretch), up));
                vec f = sub(mul(-e->kt, stretch), mul(e->ct, v));
                double most = coefficient * load, size = norm(f);
                if (size > most) {
                    f = mul(most / size, f);
                    stretch = divide(mul(-1, f), e->kt);
                }
                if (load <= 0) stretch = (vec){0, 0, 0};
                e->bristle = stretch;
                power.friction += dot(f, v);
                push = add(push, f);
                p1->f = add(p1->f, sub(mul(e->w1, push), mul(e->off * dot(push, g1), n)));
                p2->f = add(p2->f, sub(mul(e->w2, push), mul(e->off * dot(push, g2), n)));
                p3->f = add(p3->f, sub(mul(e->w3, push), mul(e->off * dot(push, g3), n)));
            } else {
                e->bristle = (vec){0, 0, 0};
            }
        }
        w->work.crease_viscosity += half * (w->power.crease_viscosity + power.crease_viscosity);
        w->work.magnetic += half * (w->power.magnetic + power.magnetic);
        w->work.ground += half * (w->power.ground + power.ground);
        w->work.friction += half * (w->power.friction + power.friction);
        w->power = power;
        for (int n = 0; n < w->nodes; n++) {
            node *p = &w->node[n];
            double m = 1 / p->mass;
            vec a = {p->free.x * p->f.x * m, p->free.y * p->f.y * m, p->free.z * p->f.z * m};
            p->v = add(p->v, mul(half, sub(a, p->a)));
            p->a = a;
            double speed = dot(p->v, p->v);
            if (!(speed <= limit)) {
                fastest = n;
                limit = fmax(speed, limit);
            }
        }
        if (fastest >= 0) {
            w->failed_step = start + s + 1;
            w->failed_node = fastest;
            return;
        }
    }
}

/* n dependent additions, one per cycle: timed, they tell the frequency of the core. */
unsigned long additions(long n) {
    unsigned long x = 0;
    for (long i = 0; i < n; i += 8) {
#define ADD __asm__ volatile("" : "+r"(x)); x += 3;
        ADD ADD ADD ADD ADD ADD ADD ADD
    }
    return x;
}
