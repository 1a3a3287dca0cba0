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
 * in *best_shift. Both images have rings * sectors >= 1 cells. The readable reference for what follows. */
uint32_t revisit_bits_min_hamming(const uint64_t* query, const uint64_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t* best_shift);

/* A query is compared with many places: it is turned once, and all its turns are then laid on a candidate together.
 * Words [word][turn], turns filled up to a multiple of 8. Buffers that start on a cache line are read twice as fast. */
size_t revisit_bits_turned_words(uint32_t rings, uint32_t sectors);
void revisit_bits_turn(const uint64_t* query, uint32_t rings, uint32_t sectors, uint64_t* turned);

/* revisit_bits_min_hamming by the fastest instructions of the processor. Gives up as soon as the distance cannot be
 * below `limit` (UINT32_MAX: never): then UINT32_MAX, and *best_shift is left alone. */
uint32_t revisit_bits_min_hamming_turned(const uint64_t* turned, const uint64_t* candidate, uint32_t rings,
                                         uint32_t sectors, uint32_t limit, uint32_t* best_shift);

/* How many cells are occupied in each of 20 columns, which are neighbouring sectors taken together (fewer sectors,
 * fewer columns; the rest is 0), at most 255 counted. The differences of these counts between a turned query and a
 * place sum to no more than the cells that differ: the smallest sum over all turns is a lower bound of the distance
 * (docs/retrieval.md). */
#define REVISIT_BITS_COLUMNS 20
#define REVISIT_BITS_BLOCK 64
void revisit_bits_columns(const uint64_t* image, uint32_t rings, uint32_t sectors,
                          uint8_t counts[REVISIT_BITS_COLUMNS]);

/* The columns of all turns of a query, each count repeated for every place of a block: [turn][column][64]. */
size_t revisit_bits_turned_columns_bytes(uint32_t sectors);
void revisit_bits_turn_columns(const uint64_t* query, uint32_t rings, uint32_t sectors, uint8_t* turned);

/* Lower bounds, at most 255, of the distances of a query to the places of `blocks` blocks. `counts` holds for each
 * block [column][place of 64], `bounds` one byte a place. */
void revisit_bits_bounds(const uint8_t* turned, uint32_t sectors, const uint8_t* counts, size_t blocks,
                         uint8_t* bounds);

#ifdef __cplusplus
}
#endif

#endif
