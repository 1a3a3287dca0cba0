/* SPDX-License-Identifier: Apache-2.0 */
/* A method of your own in `revisit compare`, as a shared library that exports revisit_method(), in any language that
 * speaks C (examples/method_plugin.c):
 *
 *     cc -shared -fPIC -I src my_method.c -o my_method.so
 *     revisit compare DRIVE --plugin ./my_method.so --out OUT
 *
 * It is scored as the built-in methods are, with --verify and --pairs. A library runs with the rights of the program.
 */
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define REVISIT_METHOD_VERSION 1

enum revisit_method_gives {
  REVISIT_GIVES_PLACE = 0,
  REVISIT_GIVES_YAW = 1,
  REVISIT_GIVES_PLANAR_POSE = 2,
  REVISIT_GIVES_POSE = 3
};

/* What the method keeps of a scan, in a form of its own. */
typedef struct revisit_signature {
  const uint64_t* words;
  size_t count;
} revisit_signature;

/* All functions may be called by several threads at once. */
typedef struct revisit_method_v1 {
  uint32_t version; /* REVISIT_METHOD_VERSION */
  /* Of letters, digits, - + ., a letter or digit first: the row of the tables, and the folder of its results. */
  const char* name;
  const char* source; /* the paper, for the tables; may be null */
  uint32_t gives;     /* one of revisit_method_gives */
  /* How many scans are described together, 1 to 1000; more than one are laid together by odometry, in the frame of the
   * last one. */
  uint32_t scans;
  uint32_t place_every; /* only each how-many-th scan is a place, 1 to 1000 */

  /* `points`: x y z in metres in the LiDAR frame and intensity in [0, 1], of `count` points one after the other;
   * `ground_z_m`: where the ground lies there. Writes at most `room` words and returns how many the signature has; it
   * is called again with as many where it has more, and must then have no more. */
  size_t (*describe)(const float* points, size_t count, double ground_z_m, uint64_t* words, size_t room);

  /* How alike two places are, larger is more alike; NaN where they have nothing in common, so that the place is no
   * answer. A signature has 0 words where describe() gave none. `T_place_query`, where it is not null: a 4 x 4 matrix,
   * row by row, metres, which comes as the identity; the pose of the query in the frame of the place is to be written
   * into it, as far as `gives` says. */
  double (*similarity)(revisit_signature query, revisit_signature place, double T_place_query[16]);
} revisit_method_v1;

/* What the library exports. What it returns stays as it is as long as the library is loaded. */
const revisit_method_v1* revisit_method(void);

#ifdef __cplusplus
}
#endif
