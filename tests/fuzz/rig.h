/* SPDX-License-Identifier: MIT */
/* What the fuzz targets share: a file in memory that has a path, a folder that goes away, bytes taken one after the
 * other, and a claim that must hold.
 *
 * A target is one file fuzz_NAME.c with LLVMFuzzerTestOneInput. What comes in is any bytes; what must come out is
 * written in its first comment. One thread. */
#ifndef TESTS_FUZZ_RIG_H
#define TESTS_FUZZ_RIG_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

/* What libFuzzer calls, with each input. Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A folder of this process below $TMPDIR, or /tmp. It is removed at exit; after a crash it stays. */
const char *fuzz_folder(void);

/* The path of a file with that ending (".ply") in the folder that has just these bytes. They are in memory: writing them costs
 * microseconds. Valid until the process ends; the next call with the same ending changes the file. Up to 8 endings. */
const char *fuzz_file(const char *ending, const uint8_t *data, size_t size);
/* A file of that name on the disk, for code that makes, renames or locks files. */
const char *fuzz_disk_file(const char *name, const uint8_t *data, size_t size);

/* Bytes that are taken from the front; after the end all are 0. */
struct fuzz_bytes {
    const uint8_t *p;
    size_t n;
};
unsigned fuzz_u8(struct fuzz_bytes *from);
unsigned fuzz_u16(struct fuzz_bytes *from);
uint32_t fuzz_u32(struct fuzz_bytes *from);
/* At most n bytes; *got says how many. */
const uint8_t *fuzz_take(struct fuzz_bytes *from, size_t n, size_t *got);

/* Ends the process with the words, as a crash that libFuzzer keeps, unless ok. */
void fuzz_must(int ok, const char *words);
/* A refusal is one line of printable text, without anything after it. */
void fuzz_must_be_line(const struct sh_err *err);

/* Warnings and progress are dropped; they must be one line, too. */
extern const struct sh_report fuzz_report;

#endif
