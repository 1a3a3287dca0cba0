/* SPDX-License-Identifier: Apache-2.0 */
#ifndef REVISIT_BITS_OCCUPANCY_BITS_H_
#define REVISIT_BITS_OCCUPANCY_BITS_H_

#include <stddef.h>
#include <stdint.h>

/* A polar occupancy image, one bit a cell: bit (sector * rings + ring), 64 bits a word, unused bits of the
 * last word zero. Turning the image by k sectors rotates the string of bits by k * rings.
 * No allocation, no exceptions, no state: callable from C and from any number of threads. */
#ifdef __cplusplus
extern "C" {
#endif

/* Words of an image of `cells` bits. */
size_t revisit_bits_words(uint32_t cells);

/* The smallest number of differing cells over all shifts k in [0, sectors) of the query's columns
 * (column j of the query laid on column j + k of the candidate); the first shift that reaches it is stored
 * in *best_shift. Both images have rings * sectors >= 1 cells. */
uint32_t revisit_bits_min_hamming(const uint64_t* query, const uint64_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t* best_shift);

#ifdef __cplusplus
}
#endif

#endif
