/* SPDX-License-Identifier: MIT */
/* Fuzzing would never guess checksums, so this makes those of all frames in a stream right. */
#ifndef TESTS_FUZZ_SEAL_H
#define TESTS_FUZZ_SEAL_H

#include <stddef.h>
#include <stdint.h>

/* Each sync byte outside of a frame is taken to begin one, whatever follows. A length that reaches beyond the end is
 * cut to the bytes that are there. A frame with the flag 0x80 loses the flag and keeps its checksums, so that hurt
 * frames come, too. The search goes on after the frame. */
void fuzz_seal(uint8_t *stream, size_t len);

#endif
