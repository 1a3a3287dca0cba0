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

/* A place: what is known of it beside its image, and the image, which follows at once, filled up with zeros to a
 * multiple of 8 words. Counts of occupied cells are of regions and cut at 255; from them follow lower bounds of
 * distances (docs/retrieval.md). */
#define REVISIT_BITS_COLUMNS 20 /* neighbouring sectors taken together; fewer sectors, fewer columns */
#define REVISIT_BITS_REGIONS 40 /* the inner and the outer rings of each column */
typedef struct {
  uint8_t fine[REVISIT_BITS_REGIONS]; /* [column][inner, outer] */
  uint32_t occupied;
  uint32_t unused;
} revisit_bits_place;
size_t revisit_bits_place_bytes(uint32_t rings, uint32_t sectors);
void revisit_bits_make_place(const uint64_t* image, uint32_t rings, uint32_t sectors, revisit_bits_place* place,
                             uint8_t columns[REVISIT_BITS_COLUMNS]);

/* A query, prepared for comparisons with many places: all its turns, up to 1,024, and the counts of all of them. */
#define REVISIT_BITS_BLOCK 64
typedef struct {
  uint32_t rings, sectors, occupied;
  const uint64_t* images; /* [turn][word], words filled up to a multiple of 8 */
  const uint8_t* coarse;  /* [turn][column] */
  const uint8_t* fine;    /* [region / 8][turn][region % 8], turns filled up to a multiple of 8 */
} revisit_bits_query;
/* `memory` of that many bytes, on a cache line, holds what the query points to. */
size_t revisit_bits_query_bytes(uint32_t rings, uint32_t sectors);
void revisit_bits_prepare(const uint64_t* image, uint32_t rings, uint32_t sectors, void* memory,
                          revisit_bits_query* query);

/* Half of a lower bound (2 h <= distance, h at most 255) for each place of `blocks` blocks of 64 places, and the least
 * of each block. `coarse` holds [block][column][place of 64] and starts on a cache line, `occupied` one number a
 * place. */
void revisit_bits_half_bounds(const revisit_bits_query* query, const uint8_t* coarse, const uint32_t* occupied,
                              size_t blocks, uint8_t* half_bounds, uint8_t* least);

/* Which of 64 bytes lie in [low, most], low <= most: one bit each. */
uint64_t revisit_bits_between(const uint8_t bytes[REVISIT_BITS_BLOCK], uint8_t low, uint8_t most);

/* The distance at that turn whose bound is least: the minimum is at most this. */
uint32_t revisit_bits_hamming_at_promising_turn(const revisit_bits_query* query, const revisit_bits_place* place);

/* revisit_bits_min_hamming of a query and up to 64 places, one after the other from `places` on, `place_bytes` apart:
 * those named by the bits of `which`. Only turns whose bound allows a distance below `limit` are compared. Returned are
 * the places that are below it, one bit each; for these, distances and shifts are those of revisit_bits_min_hamming. */
uint64_t revisit_bits_compare(const revisit_bits_query* query, const revisit_bits_place* places, size_t place_bytes,
                              uint64_t which, uint32_t limit, uint32_t distances[REVISIT_BITS_BLOCK],
                              uint32_t shifts[REVISIT_BITS_BLOCK]);

/* How many bits are set in both. */
uint64_t revisit_bits_common(const uint64_t* a, const uint64_t* b, size_t words);

/* For two polar images of one byte a cell, the query turned by `shift` sectors: for each sector of the query the sums
 * over its rings of q * q, c * c and q * c. `sums` has room for 3 * sectors; rings <= 66,000 cannot overflow. */
void revisit_bits_sector_products(const uint8_t* query, const uint8_t* candidate, uint32_t rings, uint32_t sectors,
                                  uint32_t shift, uint32_t* sums);

#ifdef __cplusplus
}
#endif

#endif
