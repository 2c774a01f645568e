/* docs/examples/python/plate.py in C: a rigid square plate that moves up and down on a spring, m u'' = F - k u - c u'.
 *
 *   [plate]
 *   command = ["./plate", "2.0", "800.0", "8.0"]     # mass [kg], spring [N/m], dashpot [N s/m]
 *
 * Its surface is "top", a square of 1 m. The motion is exact under the mean force of a window. */
#include <acopla.h>
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
  double m, k, c;
  double u, v;
  double saved_u, saved_v;
} plate;

static int save(void* self) {
  plate* p = self;
  p->saved_u = p->u;
  p->saved_v = p->v;
  return 0;
}

static int restore(void* self) {
  plate* p = self;
  p->u = p->saved_u;
  p->v = p->saved_v;
  return 0;
}

static void move(plate* p, double force, double h) {
  const double rest = force / p->k, decay = p->c / (2 * p->m);
  const double complex w = csqrt(p->k / p->m - decay * decay); /* imaginary where the plate is overdamped */
  const double cosine = creal(ccos(w * h)), sine = cabs(w) > 0 ? creal(csin(w * h) / w) : h;
  const double d = p->u - rest, v = p->v, shrink = exp(-decay * h);
  p->u = rest + shrink * (d * cosine + (v + decay * d) * sine);
  p->v = shrink * (v * cosine - (decay * v + p->k / p->m * d) * sine);
}

/* Returns what acopla_next() returned last: 0 where the run ended well. */
static int run(acopla_participant* run, plate* p) {
  const double points[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  const unsigned char kind = ACOPLA_QUAD4;
  const int32_t nodes[] = {0, 1, 2, 3};
  double mass[12] = {0};
  for (int corner = 0; corner < 4; ++corner) mass[3 * corner + 2] = p->m / 4;
  if (acopla_offer_surface(run, "top", 4, points, 1, &kind, nodes) != 0 || acopla_set_initial(run, "top", "mass", mass) != 0 ||
      acopla_ready(run) != 0)
    return -1;
  acopla_window window;
  int state;
  while ((state = acopla_next(run, &window)) == 1) {
    const double* force = acopla_received(run, "top", "force");
    double sum = 0, u[12] = {0}, v[12] = {0};
    for (int corner = 0; force && corner < 4; ++corner) sum += force[3 * corner + 2];
    move(p, sum, window.length);
    for (int corner = 0; corner < 4; ++corner) {
      u[3 * corner + 2] = p->u;
      v[3 * corner + 2] = p->v;
    }
    acopla_report(run, "u", p->u);
    acopla_report(run, "v", p->v);
    if (acopla_send(run, "top", "displacement", u) != 0 || acopla_send(run, "top", "velocity", v) != 0 || acopla_answer(run, 1) != 0) return -1;
  }
  return state == 0 ? acopla_finish(run) : state;
}

int main(int argc, char** argv) {
  if (argc != 4) {
    fprintf(stderr, "usage: plate MASS SPRING DASHPOT, from `acopla run`\n");
    return 2;
  }
  plate p = {atof(argv[1]), atof(argv[2]), atof(argv[3]), 0, 0, 0, 0};
  const acopla_options options = {.solver = "plate", .dimension = 3, .save = save, .restore = restore, .self = &p};
  acopla_participant* participant = acopla_connect(&options);
  if (!participant) {
    fprintf(stderr, "plate: %s\n", acopla_error(NULL));
    return 1;
  }
  const int code = run(participant, &p);
  if (code != 0) {
    fprintf(stderr, "plate: %s\n", acopla_error(participant));
    acopla_fail(participant, acopla_error(participant), 0);
  }
  acopla_close(participant);
  return code != 0;
}
