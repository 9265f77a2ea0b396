/* SPDX-License-Identifier: MIT */
/* The inputs of a job, as hashes: two jobs whose structs are equal make the same bytes. In: a configuration, the files
 * that it names, and a job's settings. Out: a struct batch_provenance.
 *
 * Paths of input files don't count, their content does. So a campaign may go on where its folders are mounted
 * elsewhere. One thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_BATCH_PROVENANCE_H
#define FIRMWARE_SIM_APP_STUDIO_BATCH_PROVENANCE_H

#include <stddef.h>
#include <stdint.h>
#include <sys/stat.h>

struct config;
struct sh_err;
struct sh_report;

enum { BATCH_SHA_LEN = 65 };

struct batch_provenance {
    char program[32];                  /* its version */
    char engine[96];                   /* Embree and instruction set of that machine (bvh_engine) */
    char configuration[BATCH_SHA_LEN]; /* the text of the file */
    char inputs[BATCH_SHA_LEN];        /* all files that the configuration reads, and those that its meshes name */
    char job[BATCH_SHA_LEN];           /* station, values of keys, options */
};

/* Returns in words how `b` differs from `a`; NULL: it doesn't. */
const char *batch_provenance_differs(const struct batch_provenance *a, const struct batch_provenance *b);

/* Gives the SHA-256 of a whole file, and its length. SH_EINPUT: the file can't be opened. SH_EIO: a read failed. Asks
 * report whether to stop. */
int batch_sha_file(const char *path, char hex[BATCH_SHA_LEN], uint64_t *bytes, const struct sh_report *report,
                   struct sh_err *err);

/* Hashes of files that were read before. A file is read again where its inode, size or modification time differs. */
struct batch_known {
    char *path;
    struct stat st;
    char sha[BATCH_SHA_LEN];
    int is_searched;
    char **sidecar; /* the files that a mesh names: for each its name in the mesh, then its path */
    size_t n_sidecars, sidecars_room;
};
struct batch_cache {
    struct batch_known *known;
    size_t n, room;
};
void batch_cache_free(struct batch_cache *cache);

/* Fills made->configuration and made->inputs. */
int batch_provenance_of(const struct config *cfg, struct batch_cache *cache, struct batch_provenance *made,
                        const struct sh_report *report, struct sh_err *err);

/* Fills made->job from n texts; each of them counts, and so does their order. */
void batch_provenance_job(struct batch_provenance *made, const char *const *text, uint32_t n);

#endif
