/* SPDX-License-Identifier: MIT */
/* Import in a process of its own. On some broken files Assimp and the readers of IFC crash, never end, or
 * take all memory. The readers of glTF and GeoTIFF call decoders of others. So each of them reads in a process of its
 * own, with limits. Each result is checked before it is used.
 *
 *   import_apart.c     this process: starts the other ones, watches them, reports how they ended
 *   import_child.c     the other process: its limits, its messages, its work, or the program that does it
 *   import_assimp.c    the work: Assimp's nodes and meshes into a builder, as the other readers fill one
 *   import_result.c    the scene on its way back: written there, read and checked here */
#ifndef CORE_IMPORT_IMPORT_APART_H
#define CORE_IMPORT_IMPORT_APART_H

#include <stdbool.h>

#include "core/import/import_child.h"

/* At the end of errors, after ": ". */
#define IMPORT_ELSE_CONVERT "export the mesh again, or convert it to .obj or .ply"
/* The name of RLIMIT_AS in errors. */
#define IMPORT_USER_LIMIT "`ulimit -v`"

/* Bytes of a process, as the kernel counts them; 0: not known. */
enum import_memory { IMPORT_ADDRESSES, IMPORT_RESIDENT };
uint64_t import_memory_of(pid_t pid, enum import_memory which);

/* A process that reads, as its parent sees it. */
enum import_end { IMPORT_ENDED, IMPORT_STOPPED, IMPORT_TIME, IMPORT_MEMORY };
struct import_apart {
    struct import_task task; /* name, b, limits, and argv or read by the caller */
    int result_fd, note[2], pid_fd;
    pid_t pid;
    int64_t start_ns, end_ns; /* when it began, and when it must have ended */
    uint64_t most_bytes;      /* limit of its resident memory */
    int is_over, status;      /* whether the process has ended; its status as waitpid gives it */
    enum import_end end;
    bool is_shortened; /* end_ns comes from the other reader */
    int n_warnings;
    struct sh_err said; /* the error that it reported; code 0: none */
};
/* Fails where no process can be made; nothing is open then. */
int import_start(struct import_apart *a, struct sh_err *err);
/* Waits until all n <= 2 are over. Once one has ended as it should, the other may go on for ten times as long as that
 * one took, or for 10 s where that is more. */
void import_watch(struct import_apart *const a[], size_t n);
/* Returns how the process ended: 0, or the error. With 0, result_fd has its result. */
int import_judge(struct import_apart *a, struct sh_err *err);
void import_close(struct import_apart *a);

#endif
