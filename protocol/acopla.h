/* Lets a solver in C, Fortran or anything that can call C take part in a coupled run; no C++ types. Link acopla::participant
 * (find_package(Acopla)), or libacopla-participant.so. docs/examples/c/plate.c is a whole participant.
 *
 *   acopla_participant* p = acopla_connect(&options);
 *   acopla_offer_surface(p, "top", points, xyz, faces, kinds, nodes);
 *   acopla_ready(p);
 *   acopla_window window;
 *   while ((state = acopla_next(p, &window)) == 1) {
 *     const double* force = acopla_received(p, "top", "force");
 *     …
 *     acopla_send(p, "top", "displacement", u);
 *     acopla_answer(p, steps);
 *   }
 *   if (state == 0) acopla_finish(p);
 *   acopla_close(p);
 *
 * SI units; arrays are [points][3], z = 0 in 2D; times are integer ticks (docs/protocol.md). Functions that return int return 0 where they
 * did what they should and -1 where they did not, unless they say otherwise; acopla_error() then says why, in a sentence. A pointer to text
 * or numbers that is returned stays good until the next call with the same participant. A participant is used by one thread at a time. */
#ifndef ACOPLA_H
#define ACOPLA_H

#include <stddef.h>
#include <stdint.h>

#if defined(ACOPLA_BUILDS_PARTICIPANT)
#define ACOPLA_API __attribute__((visibility("default")))
#else
#define ACOPLA_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct acopla_participant acopla_participant;

/* Called by acopla_next() between windows. Return 0, or anything else for a failure, which ends the run. */
typedef int (*acopla_state_handler)(void* self);
typedef int (*acopla_folder_handler)(void* self, const char* folder);

typedef struct acopla_options {
  const char* solver;   /* what it is, for people */
  int dimension;        /* 2 or 3; must be the case's */
  const char* endpoint; /* NULL: ACOPLA_ENDPOINT of the environment, which `acopla run` sets */
  const char* name;     /* NULL: ACOPLA_PARTICIPANT */
  const char* keys;     /* folder with participant.keys, for tcp beyond loopback; NULL: ACOPLA_KEYS, or none */
  /* Remember the present state, and return to it as often as asked (implicit schemes); both or neither. */
  acopla_state_handler save, restore;
  /* Write files that begin with the participant's name into a folder, and go on from them; both or neither. */
  acopla_folder_handler checkpoint, resume;
  void* self;           /* given to the handlers */
} acopla_options;

typedef struct acopla_window {
  int64_t start, end;        /* ticks */
  double start_time, length; /* s */
  int estimate;              /* 1: `stiffness` and `dashpot` of what touches the surfaces are wanted too, where known */
} acopla_window;

/* Kinds of faces, whose nodes stand in VTK's order. */
enum { ACOPLA_LINE2 = 1, ACOPLA_LINE3 = 2, ACOPLA_TRIANGLE3 = 3, ACOPLA_TRIANGLE6 = 4, ACOPLA_QUAD4 = 5, ACOPLA_QUAD9 = 6 };

/* Says hello and waits for the coupler. NULL: it failed, and acopla_error(NULL) says why. */
ACOPLA_API acopla_participant* acopla_connect(const acopla_options* options);
/* Ends the connection; one that is closed before acopla_finish() or acopla_fail() ends the run. NULL is allowed. */
ACOPLA_API void acopla_close(acopla_participant* p);
/* What went wrong last with this participant; with NULL, with acopla_connect() in this thread. */
ACOPLA_API const char* acopla_error(const acopla_participant* p);

/* --- the run, once connected --- */
ACOPLA_API double acopla_tick(const acopla_participant* p);          /* length of a tick [s] */
ACOPLA_API int64_t acopla_end(const acopla_participant* p);          /* end of coupled time [ticks] */
ACOPLA_API int64_t acopla_window_length(const acopla_participant* p); /* nominal length of a window [ticks] */
ACOPLA_API const double* acopla_gravity(const acopla_participant* p); /* 3 numbers [m/s2] */
ACOPLA_API const char* acopla_results(const acopla_participant* p);  /* folder for own results; "": write none */
ACOPLA_API int acopla_resumes(const acopla_participant* p);          /* 1: the handler `resume` will be called before the first window */
ACOPLA_API int acopla_wants_mass(const acopla_participant* p);       /* 1: surfaces that send their motion should bring "mass" (below), if it is known */
ACOPLA_API size_t acopla_use_count(const acopla_participant* p);     /* surfaces that are coupled */
ACOPLA_API const char* acopla_use(const acopla_participant* p, size_t k); /* name of one; NULL beyond the last */
ACOPLA_API int acopla_receives(const acopla_participant* p, const char* surface, const char* field); /* 1 or 0 */
ACOPLA_API int acopla_sends(const acopla_participant* p, const char* surface, const char* field);    /* 1 or 0 */

/* --- surfaces, before acopla_ready() --- */
/* kinds: one a face; nodes: point numbers from 0, all faces one after another. Without faces kinds and nodes may be NULL. */
ACOPLA_API int acopla_offer_surface(acopla_participant* p, const char* surface, size_t points, const double* xyz, size_t faces,
                                    const unsigned char* kinds, const int32_t* nodes);
/* Where a surface is and how it moves when coupled time begins: field "displacement" [m], "velocity" [m/s] per point; or "mass" [kg], what a sudden force
   on that point alone would accelerate, by direction. */
ACOPLA_API int acopla_set_initial(acopla_participant* p, const char* surface, const char* field, const double* values);
ACOPLA_API int acopla_ready(acopla_participant* p);

/* --- windows --- */
/* Waits for the next window. 1: compute it and answer; 0: the run ends well; -1: it failed. */
ACOPLA_API int acopla_next(acopla_participant* p, acopla_window* window);
/* A field that came with the window, [points][3]; NULL where none did. */
ACOPLA_API const double* acopla_received(acopla_participant* p, const char* surface, const char* field);
/* A field of the answer, [points][3]; copied. */
ACOPLA_API int acopla_send(acopla_participant* p, const char* surface, const char* field, const double* values);
/* A scalar of the answer, or of the summary before acopla_finish(), named as [expect] names it. */
ACOPLA_API int acopla_report(acopla_participant* p, const char* quantity, double value);
/* Answers the window. steps: the solver's own in it. */
ACOPLA_API int acopla_answer(acopla_participant* p, uint64_t steps);

/* --- the end --- */
ACOPLA_API int acopla_finish(acopla_participant* p);
/* Tells the user why the solver cannot go on, in these words; the run ends. mistake: 1 where the user has to mend something, and text is a
 * located sentence that is shown as it is. */
ACOPLA_API int acopla_fail(acopla_participant* p, const char* text, int mistake);

#ifdef __cplusplus
}
#endif
#endif
