/* SPDX-License-Identifier: MIT */
/* A text file whose lines are written by a thread of its own, so that no caller waits for a disk or a reader.
 *
 * In: lines. Out: the same lines in the file, whole and in order. Between both is a queue of a fixed size. A line that
 * finds no room in it is dropped, whole, and counted. Before the next line that is written, a line in the file says how
 * many are missing there (`gap`). After the first error in writing all lines are dropped and counted.
 *
 * There are two kinds of lines. A remark is dropped when it would fill the queue beyond one half. So a flood of remarks
 * leaves room for the other lines.
 *
 * Thread: any but the pacing thread, since line_writer_put holds a lock while a line is copied. line_writer_put neither
 * allocates nor writes, so it may be called with other locks held. */
#ifndef FIRMWARE_SIM_BASE_LINE_WRITER_H
#define FIRMWARE_SIM_BASE_LINE_WRITER_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

enum line_kind { LINE_PLAIN, LINE_REMARK, LINE_KINDS };
enum { LINE_MOST_BYTES = 2048, LINE_GAP_BYTES = 160 };

struct line_writer_spec {
    int fd;                  /* for writing; the writer's from here on, also after a failure */
    const char *what, *path; /* errors begin with them: "journal: FILE"; the caller's */
    size_t room;             /* size of the queue in bytes, at least 2 * (LINE_MOST_BYTES + LINE_GAP_BYTES) */
    _Atomic uint64_t *lost;  /* counts the lines that are not in the file; the caller's; may be NULL */
    /* Writes the line that stands for lost[kind] lines, which are not all 0. With its '\n' it has at most
     * LINE_GAP_BYTES - 1 characters. The caller holds the writer's lock. */
    void (*gap)(char text[LINE_GAP_BYTES], const uint64_t lost[LINE_KINDS]);
};

struct line_writer;

int line_writer_open(const struct line_writer_spec *spec, struct line_writer **out, struct sh_err *err);

/* Queues a text for the file: one or more whole lines with their '\n', at most LINE_MOST_BYTES. A text that is dropped
 * counts as one lost line. SH_ELOST: the text was dropped; SH_EIO: it was dropped, since the file can't be written. */
int line_writer_put(struct line_writer *writer, enum line_kind kind, const char *text, size_t len);

/* 1: a quarter of the queue is full; callers that can wait should, so that nothing is dropped. 0 for NULL. */
int line_writer_is_filling(const struct line_writer *writer);

/* Writes what is left, then the line `last` (NULL: none), and closes. When the file takes nothing for 2 s, the rest is
 * dropped. SH_EIO: that happened, or writing failed; the text says how many lines are missing in all. Lines that were
 * dropped before are counted in *lost, but are no error alone. A writer of NULL is allowed. */
int line_writer_close(struct line_writer *writer, const char *last, struct sh_err *err);

#endif
