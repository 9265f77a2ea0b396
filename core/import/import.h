/* SPDX-License-Identifier: MIT */
/* Import in a process of its own. Assimp and the readers of IFC crash, hang or take all memory on some broken files.
 * The readers of glTF and GeoTIFF call decoders of others. So each of them reads in a process of its own, with limits.
 * Its result is checked before it is used.
 *
 *   import_apart.c     this process: starts the other ones, looks after them, says how they ended
 *   import_child.c     the other process: its limits, its messages, its work, or the program that does it
 *   import_assimp.c    the work: Assimp's nodes and meshes into a builder, as the other readers fill one
 *   import_result.c    the scene on its way back: written there, read and checked here */
#ifndef CORE_IMPORT_IMPORT_H
#define CORE_IMPORT_IMPORT_H

#include <sys/types.h>

#include "core/import/readers.h"

/* ---- messages of the child, by a pipe, each written in one piece */

enum import_note_kind { IMPORT_WARNING = 1, IMPORT_PROGRESS, IMPORT_ERROR };

struct import_note {
    int32_t kind, code; /* code: of an error */
    double fraction;    /* of a progress */
    char text[512];
};

/* The child gets this. */
struct import_task {
    struct scene_build *b; /* of the parent; the child only reads it */
    struct scene_import_limits limits;
    const char *name;        /* of the reader, for messages */
    const char *const *argv; /* a program that reads, NULL-terminated, found by PATH; NULL: `read`, in a fork */
    int (*read)(struct scene_build *b, struct sh_err *err); /* fills a builder of the fork */
    pid_t parent;
    int result_fd, note_fd; /* the scene, the messages; a program finds them as 3 and 4 */
};

/* ---- import_apart.c */

/* At the end of errors, after ": ". */
#define IMPORT_ELSE_CONVERT "export the mesh again, or convert it to .obj or .ply"

/* Bytes of a process, as the kernel counts them; 0: not known. */
enum import_memory { IMPORT_ADDRESSES, IMPORT_RESIDENT };
uint64_t import_memory_of(pid_t pid, enum import_memory which);

/* One process that reads, as this one sees it. */
enum import_end { IMPORT_ENDED, IMPORT_STOPPED, IMPORT_TIME, IMPORT_MEMORY };
struct import_apart {
    struct import_task task; /* name, argv, b and limits by the caller */
    int result_fd, note[2], pid_fd;
    pid_t pid;
    int64_t start_ns, end_ns; /* begin, and the latest end */
    uint64_t most_bytes;      /* its resident memory */
    int is_over, status;      /* as of waitpid */
    enum import_end end;
    int n_warnings;
    struct sh_err said; /* its error */
};
/* Fails where no process can be made; nothing is open then. */
int import_start(struct import_apart *a, struct sh_err *err);
/* Waits until all n <= 2 are over. Once one has ended as it should, the other gets ten times as long as that one took,
 * or 10 s where that is more. */
void import_watch(struct import_apart *const a[], size_t n);
/* Returns how the process ended: 0, or the error. With 0, result_fd has its result. */
int import_judge(struct import_apart *a, struct sh_err *err);
void import_close(struct import_apart *a);

/* ---- import_child.c */

/* Reads the file that b is at, in a process that was just forked with all signals blocked. Exit status 0: the
 * scene is written. */
_Noreturn void import_child(const struct import_task *task);

/* ---- import_assimp.c: fills b as a reader does. Needs the whole process: Assimp's logger is global. */
int import_assimp(struct scene_build *b, struct sh_err *err);

/* ---- import_result.c */

/* Writes the scene to an empty file. Its arrays are released on the way. */
int import_result_write(struct scene *scene, int fd, struct sh_err *err);

/* Adds the scene in the file to b, after b's other files. Nothing in it is trusted: SH_EINPUT says what is
 * wrong. The parts that have been read are cut out of the file, to free memory. */
int import_result_read(struct scene_build *b, int fd, struct sh_err *err);

#endif
