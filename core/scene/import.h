/* Import by Assimp, apart. Assimp crashes, hangs or takes all memory on some broken files; so it reads in a
 * process of its own, with limits, and what it gives is checked before it is used.
 *
 *   import_apart.c     this process: starts the other one, looks after it, says how it ended
 *   import_child.c     the other process: its limits, its messages, its work
 *   import_assimp.c    the work: Assimp's nodes and meshes into a builder, as the other readers fill one
 *   import_result.c    the scene on its way back: written there, read and checked here */
#ifndef CORE_SCENE_IMPORT_H
#define CORE_SCENE_IMPORT_H

#include <sys/types.h>

#include "core/scene/build.h"

/* ---- messages of the child, by a pipe, each written in one piece */

enum import_note_kind { IMPORT_WARNING = 1, IMPORT_PROGRESS, IMPORT_ERROR };

struct import_note {
    int32_t kind, code; /* code: of an error */
    double fraction;    /* of a progress */
    char text[512];
};

/* ---- import_apart.c */

/* Bytes of a process, as the kernel counts them; 0: not known. */
enum import_memory { IMPORT_ADDRESSES, IMPORT_RESIDENT };
uint64_t import_memory_of(pid_t pid, enum import_memory which);

/* ---- import_child.c */

/* What the child gets. */
struct import_task {
    struct scene_build *b; /* of the parent; the child only reads it */
    struct scene_import_limits limits;
    pid_t parent;
    int result_fd, note_fd; /* the scene, the messages */
};

/* Reads the file that b is at, in a process that was just forked with all signals blocked. Exit status 0: the
 * scene is written. */
_Noreturn void import_child(const struct import_task *task);

/* ---- import_assimp.c: fills b as a reader does. Needs the whole process: Assimp's logger is global. */
int import_assimp(struct scene_build *b, struct sh_err *err);

/* ---- import_result.c */

/* Writes the scene to an empty file. Its arrays are released on the way. */
int import_result_write(struct scene *scene, int fd, struct sh_err *err);

/* Adds the scene in the file to b, after b's other files. Nothing in it is trusted: SH_EINPUT says what is
 * wrong. What has been read is cut out of the file. */
int import_result_read(struct scene_build *b, int fd, struct sh_err *err);

#endif
