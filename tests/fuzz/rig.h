/* SPDX-License-Identifier: MIT */
/* The fuzz targets share this: a file in memory that has a path, a folder that goes away, bytes taken one after the
 * other, and a claim that must hold.
 *
 * A target is one file fuzz_NAME.c with LLVMFuzzerTestOneInput. Its input is any bytes, and its first comment says what
 * must come out. There is one thread. */
#ifndef TESTS_FUZZ_RIG_H
#define TESTS_FUZZ_RIG_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

/* libFuzzer calls this function with each input. Returns 0. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Returns a folder of this process below $TMPDIR, or /tmp. The folder is removed at exit, but stays after a crash. */
const char *fuzz_folder(void);

/* Returns the path of a file with that ending (".ply") in the folder, which has just these bytes. The bytes are in
 * memory, so writing them costs microseconds. The path is valid until the process ends, and the next call with the same
 * ending changes the file. There may be up to 8 endings. */
const char *fuzz_file(const char *ending, const uint8_t *data, size_t size);
/* Writes a file of that name on the disk, for code that makes, renames or locks files. */
const char *fuzz_disk_file(const char *name, const uint8_t *data, size_t size);

/* Bytes are taken from the front. After the end all are 0. */
struct fuzz_bytes {
    const uint8_t *p;
    size_t n;
};
unsigned fuzz_u8(struct fuzz_bytes *from);
unsigned fuzz_u16(struct fuzz_bytes *from);
uint32_t fuzz_u32(struct fuzz_bytes *from);
/* Takes at most n bytes. *got says how many. */
const uint8_t *fuzz_take(struct fuzz_bytes *from, size_t n, size_t *got);

/* Ends the process with the words unless ok, as a crash that libFuzzer keeps. */
void fuzz_must(int ok, const char *words);
/* A refusal must be one line of printable text, without anything after it. */
void fuzz_must_be_line(const struct sh_err *err);

/* Warnings and progress are dropped. They must be one line, too. */
extern const struct sh_report fuzz_report;

#endif
