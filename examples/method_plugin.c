/* SPDX-License-Identifier: Apache-2.0 */
/* A method of one's own in `revisit compare` (baseline_plugin.h): how many points lie how far away and how high, which
 * is the same whichever way the sensor looks.
 *
 *     cc -shared -fPIC -I src examples/method_plugin.c -o method_plugin.so -lm
 *     revisit compare DRIVE --plugin ./method_plugin.so --methods revisit,scan-context --out OUT */
#include <math.h>
#include <string.h>

#include <revisit/descriptors/baseline_plugin.h>

enum { RANGES = 40, HEIGHTS = 8, CELLS = RANGES * HEIGHTS, WORDS = CELLS * sizeof(float) / sizeof(uint64_t) };

static size_t describe(const float* points, size_t count, double ground_z_m, uint64_t* words, size_t room) {
  float cells[CELLS] = {0}, sum = 0;
  if (room < WORDS) return WORDS;
  for (size_t i = 0; i < count; ++i) {
    const float* p = points + 4 * i;
    const float range = hypotf(p[0], p[1]) / 2, height = (p[2] - (float)ground_z_m) + 1; /* cells of 2 m by 1 m */
    if (range < RANGES && height >= 0 && height < HEIGHTS) ++cells[(int)range * HEIGHTS + (int)height];
  }
  for (int i = 0; i < CELLS; ++i) sum += cells[i] = sqrtf(cells[i]);
  for (int i = 0; i < CELLS && sum > 0; ++i) cells[i] /= sum;
  memcpy(words, cells, sizeof cells);
  return WORDS;
}

static double similarity(revisit_signature query, revisit_signature place, double T_place_query[16]) {
  const float *a = (const float*)query.words, *b = (const float*)place.words;
  double different = 0;
  (void)T_place_query; /* it says nothing of the pose */
  if (query.count != WORDS || place.count != WORDS) return NAN;
  for (int i = 0; i < CELLS; ++i) different += fabsf(a[i] - b[i]);
  return 1 - different / 2;
}

static const revisit_method_v1 method = {
    REVISIT_METHOD_VERSION, "ranges-and-heights", "an example", REVISIT_GIVES_PLACE, 1, 1, describe, similarity};

const revisit_method_v1* revisit_method(void) { return &method; }
