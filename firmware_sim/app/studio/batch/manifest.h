/* SPDX-License-Identifier: MIT */
/* The finished jobs of a campaign. Each shard has a file manifest-I-of-N.jsonl in the campaign's folder, a line of JSON
 * for each job that it has finished; nothing but whole lines counts. Out: the entries of all such files of a folder.
 *
 * The file is locked while its shard runs. Lines are appended and synced one by one. One thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_BATCH_MANIFEST_H
#define FIRMWARE_SIM_APP_STUDIO_BATCH_MANIFEST_H

#include "firmware_sim/app/studio/batch/provenance.h"
#include "firmware_sim/app/studio/batch/sweep.h"

struct json;

struct batch_file {
    char name[BATCH_NAME_LEN + 32]; /* in the campaign's folder */
    uint64_t bytes;
    char sha[BATCH_SHA_LEN];
};

struct batch_entry {
    uint32_t job; /* its number, from 1 */
    struct batch_provenance made;
    uint64_t pulses, points;
    char stream_sha[BATCH_SHA_LEN];
    double seconds; /* that it took */
    struct batch_file *file;
    uint32_t n_files;
};
void batch_entry_free(struct batch_entry *entry);

/* Reads a line without its newline; *entry is to be freed. Returns 0 where batch_manifest_add did not write it, or not
 * all of it. */
int batch_entry_read(const char *line, struct batch_entry *entry);

/* Gives every entry of every manifest of the folder to `take`, file by file, in the order of their lines. A job may
 * stand in a file twice; both entries are given. `take` owns the entry. Lines that can't be read are warned of, except
 * for an unfinished last one: its writer may have been killed, or still be there. */
int batch_manifest_read(const char *dir, int (*take)(void *ctx, struct batch_entry *entry, struct sh_err *err),
                        void *ctx, const struct sh_report *report, struct sh_err *err);

/* Opens a shard's manifest to append; an unfinished last line is cut off. SH_ESTATE: another process has it. */
int batch_manifest_open(const char *dir, uint32_t shard, uint32_t n_shards, int *fd, struct sh_err *err);
int batch_manifest_add(int fd, const struct batch_entry *entry, struct sh_err *err);

/* Writes the entry's files as a member of the open object. */
void batch_put_files(struct json *json, const struct batch_entry *entry);

#endif
