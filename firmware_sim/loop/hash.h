/* SPDX-License-Identifier: MIT */
/* Computes stream_sha256 of the released ticks: a reader of the stream, with a thread of its own.
 *
 * In: the stream. Out: SHA-256 of the frames that drivers/protocol/COUNTS.md names, in hexadecimal. */
#ifndef FIRMWARE_SIM_LOOP_HASH_H
#define FIRMWARE_SIM_LOOP_HASH_H

#include "firmware_sim/loop/stream.h"

struct hasher;

/* Starts the thread. To be called before the pacing thread starts. */
int hasher_start(struct stream *stream, struct hasher **out, struct sh_err *err);
/* Waits until the stream is over and read; frees the hasher. 1: hex is the hash; 0: the hasher was too slow. */
int hasher_join(struct hasher *hasher, char hex[65]);

#endif
