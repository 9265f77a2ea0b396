/* SPDX-License-Identifier: MIT */
/* A process that reads gets a task, and sends messages back. It is a fork, or a program that does the work. */
#ifndef CORE_IMPORT_IMPORT_CHILD_H
#define CORE_IMPORT_IMPORT_CHILD_H

#include <sys/types.h>

#include "core/scene.h"
#include "core/text.h"

struct scene_build;

/* Messages of the child come by a pipe, each written in one piece. */
enum import_note_kind { IMPORT_WARNING = 1, IMPORT_PROGRESS, IMPORT_ERROR };

struct import_note {
    int32_t kind, code; /* code: of IMPORT_ERROR */
    double fraction;    /* of IMPORT_PROGRESS */
    char text[512];
};

/* The child gets this. */
struct import_task {
    struct scene_build *b; /* of the parent; the child only reads it */
    struct scene_import_limits limits;
    const char *name;        /* of the reader, for messages */
    const char *const *argv; /* a program that reads, NULL-terminated, found by PATH; NULL: `read`, in a fork */
    int (*read)(struct scene_build *b, struct sh_err *err); /* fills a builder of the fork */
    struct text_span input;                                 /* a program finds it in a file at descriptor 5 */
    pid_t parent;
    int result_fd, note_fd; /* the scene, the messages; a program finds them as 3 and 4 */
};

/* Reads the file of task->b, in a process that was just forked with all signals blocked. Exit status 0: the
 * scene is written. */
_Noreturn void import_child(const struct import_task *task);

#endif
